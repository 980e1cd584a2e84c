// How large the scene is, and how far the camera may go, so that a drag does not lose the scene.
import { Vector3 } from 'three';

export interface Sphere {
  readonly center: Vector3;
  readonly radius: number;
}

/** Distances from the scene's centre that the camera and the point it looks at do not exceed. */
export interface Reach {
  readonly center: Vector3;
  readonly camera: number;
  readonly target: number;
}

/** Share of the points that are within a scene's sphere: floaters are outside. */
const shareInside = 0.9;
/** Maximum distance of the camera from the centre, in radii of the scene. */
const maxRadii = 4;

function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? 0;
}

/** Returns a sphere around most of the points; undefined without points. */
export function sphereOf(points: readonly Vector3[]): Sphere | undefined {
  if (points.length === 0) return undefined;
  const median = (axis: 'x' | 'y' | 'z') => quantile(points.map((point) => point[axis]), 0.5);
  const center = new Vector3(median('x'), median('y'), median('z'));
  const distances = points.map((point) => point.distanceTo(center));
  return { center, radius: Math.max(quantile(distances, shareInside), 1e-3) };
}

/** Returns the reach of a scene; a camera and target that are further away by choice may stay there. */
export function reachOf({ center, radius }: Sphere, camera: Vector3, target: Vector3): Reach {
  return {
    center,
    camera: Math.max(maxRadii * radius, camera.distanceTo(center)),
    target: Math.max(radius, target.distanceTo(center)),
  };
}

/** Moves the camera and its target into their reach; returns whether they were outside. */
export function keepWithin(reach: Reach, camera: Vector3, target: Vector3): boolean {
  const from = target.clone().sub(reach.center);
  const tooFar = from.length() - reach.target;
  if (tooFar > 0) {
    const back = from.clone().setLength(tooFar);
    target.sub(back);
    camera.sub(back);
  }
  if (camera.distanceTo(reach.center) <= reach.camera) return tooFar > 0;
  // The point on the line from the target to the camera at which the reach ends.
  const offset = target.clone().sub(reach.center);
  const arm = camera.clone().sub(target);
  const along = offset.dot(arm);
  const beyond = offset.lengthSq() - reach.camera ** 2;
  const share = (-along + Math.sqrt(along ** 2 - arm.lengthSq() * beyond)) / arm.lengthSq();
  camera.copy(target).addScaledVector(arm, share);
  return true;
}
