// Which Gaussians are inside an outline that is drawn over the 3D view.
import type { GaussianPly } from './gaussian_ply';
import type { GaussianSet } from './gaussian_set';
import { inChunks } from './in_chunks';

/** How Gaussians come onto the screen. */
export interface Sight {
  /** From the world to clip space, column by column, as in WebGL. */
  readonly matrix: readonly number[];
  /** Size of the picture, pixels of the screen. */
  readonly width: number;
  readonly height: number;
}

/** Side of the cells in which the nearest Gaussian is looked for, pixels. */
const cellSide = 8;
/** Opacity from which on a Gaussian hides what is behind it. */
const opaque = 0.3;
/** How far behind the nearest Gaussian others still are in front, as a share of its distance. */
const slack = 0.05;

/** Calls `visit` for each of the Gaussians in a set that is in the picture; `depth` is its distance. */
function project(
  { centers }: Pick<GaussianPly, 'centers'>,
  { matrix, width, height }: Sight,
  set: GaussianSet,
  visit: (index: number, x: number, y: number, depth: number) => void,
): Promise<void> {
  const m = Float64Array.from(matrix);
  const row = (r: number, x: number, y: number, z: number) =>
    (m[r] as number) * x + (m[r + 4] as number) * y + (m[r + 8] as number) * z + (m[r + 12] as number);
  return inChunks(set.length, (first, last) => {
    for (let i = first; i < last; ++i) {
      if (!set[i]) continue;
      const x = centers[3 * i] as number;
      const y = centers[3 * i + 1] as number;
      const z = centers[3 * i + 2] as number;
      const depth = row(3, x, y, z);
      if (depth <= 0) continue;
      const px = Math.floor((0.5 + (0.5 * row(0, x, y, z)) / depth) * width);
      const py = Math.floor((0.5 - (0.5 * row(1, x, y, z)) / depth) * height);
      if (px >= 0 && py >= 0 && px < width && py < height) visit(i, px, py, depth);
    }
  });
}

/**
 * Returns the Gaussians of a set whose centre is on a pixel of the outline's inside, however deep. `inside`: 1
 * for each of these pixels, line by line.
 */
export async function pickInside(
  gaussians: GaussianPly,
  sight: Sight,
  inside: Uint8Array,
  set: GaussianSet,
): Promise<GaussianSet> {
  const picked = new Uint8Array(set.length);
  await project(gaussians, sight, set, (i, x, y) => {
    picked[i] = inside[y * sight.width + x] as number;
  });
  return picked;
}

/**
 * Returns those that are in front: no further than a twentieth behind the nearest Gaussian with an opacity of
 * 0.3 that is in the same cell of 8 x 8 pixels. `set`: all that may be in front of them.
 */
export async function inFrontOf(
  gaussians: GaussianPly,
  sight: Sight,
  picked: GaussianSet,
  set: GaussianSet,
): Promise<GaussianSet> {
  const across = Math.ceil(sight.width / cellSide);
  const nearest = new Float32Array(across * Math.ceil(sight.height / cellSide)).fill(Infinity);
  const cellOf = (x: number, y: number) =>
    Math.floor(y / cellSide) * across + Math.floor(x / cellSide);
  await project(gaussians, sight, set, (i, x, y, depth) => {
    const cell = cellOf(x, y);
    const isOpaque = (gaussians.opacities[i] as number) >= opaque;
    if (isOpaque && depth < (nearest[cell] as number)) nearest[cell] = depth;
  });
  const front = new Uint8Array(picked.length);
  await project(gaussians, sight, picked, (i, x, y, depth) => {
    front[i] = Number(depth <= (1 + slack) * (nearest[cellOf(x, y)] as number));
  });
  return front;
}
