// The box outside of which nothing is drawn. Its faces are along the scene's axes.
import type { GaussianSet } from './gaussian_set';

/** Coordinates along x, y, z. */
export type Triple = readonly [number, number, number];

export interface CropBox {
  readonly min: Triple;
  readonly max: Triple;
}

export type Axis = 0 | 1 | 2;

export interface Face {
  readonly axis: Axis;
  readonly side: 'min' | 'max';
}

export const faces: readonly Face[] = ([0, 1, 2] as const).flatMap((axis) => [
  { axis, side: 'min' },
  { axis, side: 'max' },
]);

/** Share of the Gaussians that are between a first box's faces along each axis. */
const firstShare = 0.9;
/** Maximum number of Gaussians by which a box is chosen. */
const maxSampled = 50_000;
/** Minimum distance between two faces, as a share of the box that it was. */
const minShare = 0.01;

/** Returns the box of the middle Gaussians along each axis. `share`: how many of them. */
export function boxAround(centers: Float32Array, share = firstShare): CropBox {
  const count = centers.length / 3;
  const step = Math.max(1, Math.ceil(count / maxSampled));
  const ends = ([0, 1, 2] as const).map((axis) => {
    const values = Float32Array.from({ length: Math.floor(count / step) }, (_, i) => {
      return centers[3 * i * step + axis] as number;
    }).sort();
    const at = (quantile: number) => values[Math.round(quantile * (values.length - 1))] ?? 0;
    return [at((1 - share) / 2), at((1 + share) / 2)] as const;
  });
  const [x = [0, 0], y = [0, 0], z = [0, 0]] = ends;
  return { min: [x[0], y[0], z[0]], max: [x[1], y[1], z[1]] };
}

/** Returns the box with a face moved, which does not go past the opposite one. */
export function withFace(box: CropBox, { axis, side }: Face, to: number): CropBox {
  const [min, max] = [box.min[axis], box.max[axis]];
  const gap = minShare * (max - min);
  const coordinate = side === 'min' ? Math.min(to, max - gap) : Math.max(to, min + gap);
  const moved = [...box[side]] as [number, number, number];
  moved[axis] = coordinate;
  return { ...box, [side]: moved };
}

/** Returns the set with all Gaussians added whose centre is outside the box. */
export function withOutside(set: GaussianSet, { min, max }: CropBox, centers: Float32Array): GaussianSet {
  const all = set.slice();
  for (let i = 0; i < all.length; ++i) {
    const x = centers[3 * i] as number;
    const y = centers[3 * i + 1] as number;
    const z = centers[3 * i + 2] as number;
    const isInside =
      x >= min[0] && x <= max[0] && y >= min[1] && y <= max[1] && z >= min[2] && z <= max[2];
    if (!isInside) all[i] = 1;
  }
  return all;
}
