// The crop box in the 3D view: its edges, and a handle on each face, which a drag moves along its axis.
import {
  Box3,
  Box3Helper,
  Group,
  Mesh,
  MeshBasicMaterial,
  SphereGeometry,
  Vector3,
} from 'three';
import type { Camera, LineBasicMaterial, Ray } from 'three';
import type { CropBox, Face } from '../gaussians/crop_box';
import { faces } from '../gaussians/crop_box';

/** Radius of a handle, as a share of its distance from the camera. */
const handleShare = 0.014;
/** Radius within which a handle is taken, in radii of what is drawn. */
const slack = 1.8;
const color = 0x5eead4;

/** Returns the coordinate along an axis, from a point on, that is nearest to a ray. */
export function nearestAlong(ray: Ray, from: Vector3, axis: Vector3): number {
  const between = from.clone().sub(ray.origin);
  const cosine = axis.dot(ray.direction);
  const squared = 1 - cosine * cosine;
  if (squared < 1e-4) return 0; // the ray is along the axis
  return (cosine * between.dot(ray.direction) - between.dot(axis)) / squared;
}

export class CropHandles extends Group {
  private readonly box = new Box3();
  private readonly edges = new Box3Helper(this.box, color);
  private readonly handles = faces.map((face) => {
    const material = new MeshBasicMaterial({ color, depthTest: false, transparent: true });
    const mesh = new Mesh(new SphereGeometry(1, 16, 12), material);
    mesh.renderOrder = 2;
    return { face, mesh };
  });

  constructor() {
    super();
    const material = this.edges.material as LineBasicMaterial;
    material.depthTest = false;
    material.transparent = true;
    this.edges.renderOrder = 1;
    this.add(this.edges, ...this.handles.map(({ mesh }) => mesh));
    this.visible = false;
  }

  put(box: CropBox | undefined): void {
    this.visible = box !== undefined;
    if (!box) return;
    this.box.min.set(...box.min);
    this.box.max.set(...box.max);
    const center = this.box.getCenter(new Vector3());
    for (const { face, mesh } of this.handles) {
      mesh.position.copy(center).setComponent(face.axis, box[face.side][face.axis]);
    }
  }

  /** Keeps the handles as large on the screen wherever the camera is. */
  fitTo(camera: Camera): void {
    for (const { mesh } of this.handles) {
      mesh.scale.setScalar(handleShare * mesh.position.distanceTo(camera.position));
    }
  }

  /** Returns the face whose handle a ray hits, the nearest first. */
  faceAt(ray: Ray): Face | undefined {
    if (!this.visible) return undefined;
    const hit = this.handles
      .filter(({ mesh }) => ray.distanceToPoint(mesh.position) <= slack * mesh.scale.x)
      .sort((a, b) => a.mesh.scale.x - b.mesh.scale.x);
    return hit[0]?.face;
  }

  /** Returns where a face comes when its handle is dragged to a ray. */
  draggedTo(face: Face, ray: Ray): number {
    const axis = new Vector3().setComponent(face.axis, 1);
    const from = this.handles.find((handle) => handle.face === face)?.mesh.position ?? new Vector3();
    return from.getComponent(face.axis) + nearestAlong(ray, from, axis);
  }

  dispose(): void {
    this.edges.dispose();
    for (const { mesh } of this.handles) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
  }
}
