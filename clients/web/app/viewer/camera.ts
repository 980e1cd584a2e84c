// Cameras of the contract (x right, y down, z forward; cam_from_world) and three.js's (x right, y
// up, z backward; world_from_cam).
import { Matrix4, Quaternion, Vector3 } from 'three';
import type { PerspectiveCamera } from 'three';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { FreeCamera } from '../scene/prompt';

/** Half a turn about x, which converts between the two conventions in both directions. */
const flip = new Quaternion(1, 0, 0, 0);

export interface Pose {
  readonly position: Vector3;
  /** world_from_cam, in three.js's convention. */
  readonly rotation: Quaternion;
}

export function poseOf(view: View): Pose | undefined {
  const { rotation, translation } = view.camFromWorld ?? {};
  if (!rotation || !translation) return undefined;
  const { w, x, y, z } = rotation;
  const worldFromCam = new Quaternion(x, y, z, w).normalize().invert();
  const at = new Vector3(translation.x, translation.y, translation.z);
  const position = at.applyQuaternion(worldFromCam).negate();
  return { position, rotation: worldFromCam.multiply(flip) };
}

/** Halves of what a camera sees at a distance of 1. */
export interface Lens {
  readonly across: number;
  readonly up: number;
}

export function lensOf(view: View): Lens {
  const { width = 1, height = 1, fx = 1, fy = 1 } = view.camera ?? {};
  return { across: width / (2 * fx), up: height / (2 * fy) };
}

/** Returns the vertical field of view, degrees, at which all that a lens sees fits into a picture. */
export function fieldOfView({ across, up }: Lens, aspect: number): number {
  return (2 * Math.atan(Math.max(up, across / aspect)) * 180) / Math.PI;
}

export function upOf(poses: readonly Pose[]): Vector3 {
  const up = new Vector3();
  for (const { rotation } of poses) up.add(new Vector3(0, 1, 0).applyQuaternion(rotation));
  return up.lengthSq() > 1e-6 ? up.normalize() : new Vector3(0, 1, 0);
}

/** Returns the point that the cameras look at: the least-squares nearest point to their axes. */
export function focusOf(poses: readonly Pose[]): Vector3 | undefined {
  const sum = new Matrix4().set(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1);
  const right = new Vector3();
  const e = sum.elements;
  for (const { position, rotation } of poses) {
    const d = new Vector3(0, 0, -1).applyQuaternion(rotation);
    const axis = [d.x, d.y, d.z];
    for (let row = 0; row < 3; ++row) {
      for (let column = 0; column < 3; ++column) {
        const at = column * 4 + row;
        const away = (row === column ? 1 : 0) - (axis[row] as number) * (axis[column] as number);
        e[at] = (e[at] as number) + away;
      }
    }
    right.add(position).addScaledVector(d, -position.dot(d));
  }
  if (Math.abs(sum.determinant()) < 1e-6 * poses.length ** 3) return undefined;
  return right.applyMatrix4(sum.invert());
}

export function freeCameraOf(camera: PerspectiveCamera, width: number, height: number): FreeCamera {
  const focal = height / 2 / Math.tan((camera.fov * Math.PI) / 360);
  const position = camera.getWorldPosition(new Vector3());
  const camFromWorld = camera.getWorldQuaternion(new Quaternion()).multiply(flip).invert();
  const { x, y, z, w } = camFromWorld;
  const translation = position.applyQuaternion(camFromWorld).negate();
  return {
    width,
    height,
    fx: focal,
    fy: focal,
    cx: width / 2,
    cy: height / 2,
    rotation: { w, x, y, z },
    translation: { x: translation.x, y: translation.y, z: translation.z },
  };
}
