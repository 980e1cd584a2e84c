// The cameras of the photographs in the 3D view, as pyramids.
import { BufferGeometry, Group, LineBasicMaterial, LineSegments, Vector3 } from 'three';
import type { PerspectiveCamera } from 'three';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { lensOf, poseOf } from './camera';

interface Pyramid {
  readonly view: string;
  readonly apex: Vector3;
  /** From the apex to the corners of the picture at a distance of 1, in their order around it. */
  readonly corners: readonly Vector3[];
}

/** A position on the screen, pixels. */
interface Spot {
  readonly x: number;
  readonly y: number;
}

/** How near to a pyramid's apex the pointer is taken to be on it, pixels. */
const apexSlack = 10;
/** A pyramid is not drawn over a camera that is nearer to its apex than this, in heights. */
const nearest = 1.5;

function pyramidsOf(views: readonly View[]): Pyramid[] {
  return views.flatMap((view) => {
    const pose = poseOf(view);
    if (!pose) return [];
    const { across, up } = lensOf(view);
    const corners = [
      [-across, up],
      [across, up],
      [across, -up],
      [-across, -up],
    ].map(([x = 0, y = 0]) => new Vector3(x, y, -1).applyQuaternion(pose.rotation));
    return { view: view.view, apex: pose.position, corners };
  });
}

/** Returns whether a spot is inside a convex outline. */
export function isInside(outline: readonly Spot[], { x, y }: Spot): boolean {
  const sides = outline.map((a, i) => {
    const b = outline[(i + 1) % outline.length] as Spot;
    return Math.sign((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x));
  });
  return sides.every((side) => side > 0) || sides.every((side) => side < 0);
}

export class Frustums extends Group {
  private readonly pyramids: readonly Pyramid[];
  private readonly all = linesOf(0xffffff, 0.55);
  private readonly chosen = linesOf(0x5eead4, 1);
  private height = 0;
  /** The view whose pyramid is emphasised. */
  private emphasised = '';

  constructor(views: readonly View[]) {
    super();
    this.pyramids = pyramidsOf(views);
    this.add(this.all, this.chosen);
    this.visible = false;
  }

  /** Sets how high the pyramids are. */
  fit(height: number): void {
    this.height = height;
    this.all.geometry.setFromPoints(this.pyramids.flatMap((pyramid) => this.edgesOf(pyramid)));
    this.emphasise(this.emphasised);
  }

  emphasise(view: string): void {
    this.emphasised = view;
    const found = this.pyramids.filter((pyramid) => pyramid.view === view);
    this.chosen.geometry.dispose();
    this.chosen.geometry = new BufferGeometry().setFromPoints(
      found.flatMap((pyramid) => this.edgesOf(pyramid)),
    );
  }

  /** Returns the view whose pyramid is at a position, given as shares of width and height, the nearest first. */
  viewAt(at: Spot, camera: PerspectiveCamera, width: number, height: number): string | undefined {
    if (!this.visible || this.height === 0) return undefined;
    const spot = { x: at.x * width, y: at.y * height };
    const screen = (point: Vector3): Spot & { z: number } => {
      const { x, y, z } = point.clone().project(camera);
      return { x: (0.5 + x / 2) * width, y: (0.5 - y / 2) * height, z };
    };
    const hits = this.pyramids.flatMap(({ view, apex, corners }) => {
      const distance = apex.distanceTo(camera.position);
      if (distance < nearest * this.height) return [];
      const top = screen(apex);
      const outline = corners.map((corner) => screen(this.tip(apex, corner)));
      if ([top, ...outline].some(({ z }) => z < -1 || z > 1)) return [];
      const isNear = Math.hypot(top.x - spot.x, top.y - spot.y) <= apexSlack;
      return isNear || isInside(outline, spot) ? { view, distance } : [];
    });
    return hits.sort((a, b) => a.distance - b.distance)[0]?.view;
  }

  dispose(): void {
    for (const lines of [this.all, this.chosen]) {
      lines.geometry.dispose();
      lines.material.dispose();
    }
  }

  private tip(apex: Vector3, corner: Vector3): Vector3 {
    return apex.clone().addScaledVector(corner, this.height);
  }

  private edgesOf({ apex, corners }: Pyramid): Vector3[] {
    const tips = corners.map((corner) => this.tip(apex, corner));
    return tips.flatMap((tip, i) => [apex, tip, tip, tips[(i + 1) % tips.length] as Vector3]);
  }
}

function linesOf(color: number, opacity: number): LineSegments<BufferGeometry, LineBasicMaterial> {
  const material = new LineBasicMaterial({ color, opacity, transparent: true, depthTest: false });
  const lines = new LineSegments(new BufferGeometry(), material);
  lines.frustumCulled = false;
  lines.renderOrder = 1;
  return lines;
}
