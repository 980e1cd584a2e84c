// How Gaussians are moved: turned and scaled about a pivot, then shifted.
import type { Triple } from '../gaussians/crop_box';
import type { GaussianSet } from '../gaussians/gaussian_set';

export interface Move {
  /** Scene units. */
  readonly translation: Triple;
  /** Angles about x, y and z, degrees: p is turned about z, then y, then x. */
  readonly rotation: Triple;
  readonly scale: number;
}

/** Limits of Move.scale of the contract. */
export const minScale = 0.001;
export const maxScale = 1000;

export const noMove: Move = { translation: [0, 0, 0], rotation: [0, 0, 0], scale: 1 };

export interface Rotation {
  readonly w: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

/** Returns the rotation by angles as in Move. */
export function rotationOf(angles: Triple): Rotation {
  const [a, b, c] = angles.map((angle) => (angle * Math.PI) / 360) as [number, number, number];
  const [c1, c2, c3] = [Math.cos(a), Math.cos(b), Math.cos(c)];
  const [s1, s2, s3] = [Math.sin(a), Math.sin(b), Math.sin(c)];
  return {
    w: c1 * c2 * c3 - s1 * s2 * s3,
    x: s1 * c2 * c3 + c1 * s2 * s3,
    y: c1 * s2 * c3 - s1 * c2 * s3,
    z: c1 * c2 * s3 + s1 * s2 * c3,
  };
}

/** Returns whether a move changes anything. */
export function moves({ translation, rotation, scale }: Move): boolean {
  return scale !== 1 || [...translation, ...rotation].some((value) => value !== 0);
}

/** Returns the middle of the box of the Gaussians of a set. `centers`: x, y, z of each. */
export function middleOfSet(set: GaussianSet, centers: Float32Array): Triple {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < set.length; ++i) {
    if (!set[i]) continue;
    for (let axis = 0; axis < 3; ++axis) {
      const value = centers[3 * i + axis] as number;
      if (value < (min[axis] as number)) min[axis] = value;
      if (value > (max[axis] as number)) max[axis] = value;
    }
  }
  const middle = (axis: 0 | 1 | 2) => ((min[axis] as number) + (max[axis] as number)) / 2;
  return min[0] === Infinity ? [0, 0, 0] : [middle(0), middle(1), middle(2)];
}
