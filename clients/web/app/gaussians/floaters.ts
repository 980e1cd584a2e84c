// Floaters: Gaussians that are far from all others, or that no photograph shows.
//
// A Gaussian is a floater if
// - its centre is in the sight of no photograph's camera, with a margin of a tenth of the picture, or
// - fewer than 4 other centres are within its reach. The reach is 4 times the spacing that as many points would
//   have on the sphere around the middle 90 % of the Gaussians. A Gaussian whose standard deviation exceeds the
//   reach is large by itself, as walls and skies are, and not a floater by this rule.
import type { GaussianPly } from './gaussian_ply';
import type { GaussianSet } from './gaussian_set';

/** A photograph's camera, as in the contract: x right, y down, z forward. */
export interface SightOfPhotograph {
  /** From the world to the camera, line by line: 3 x 4 numbers. */
  readonly camFromWorld: readonly number[];
  /** Halves of the picture at a distance of 1. */
  readonly across: number;
  readonly up: number;
}

const margin = 0.1;
const minNeighbours = 4;
const reachInSpacings = 4;
const shareInside = 0.9;
const maxSampled = 20_000;

function quantile(values: Float32Array, share: number): number {
  const sorted = values.slice().sort();
  return sorted[Math.floor(share * (sorted.length - 1))] ?? 0;
}

/** Returns how near the neighbours of a Gaussian must be. */
export function reachOfNeighbours(centers: Float32Array): number {
  const count = centers.length / 3;
  const step = Math.max(1, Math.ceil(count / maxSampled));
  const length = Math.floor(count / step);
  const [x = new Float32Array(), y = x, z = x] = [0, 1, 2].map((axis) =>
    Float32Array.from({ length }, (_, i) => centers[3 * i * step + axis] as number),
  );
  const [mx, my, mz] = [quantile(x, 0.5), quantile(y, 0.5), quantile(z, 0.5)];
  const distances = x.map((value, i) =>
    Math.hypot(value - mx, (y[i] as number) - my, (z[i] as number) - mz),
  );
  const radius = quantile(distances, shareInside);
  return reachInSpacings * radius * Math.sqrt((4 * Math.PI) / Math.max(1, count));
}

/** Returns whether a photograph's camera sees a point. */
function sees(photograph: SightOfPhotograph, x: number, y: number, z: number): boolean {
  const { camFromWorld: m, across, up } = photograph;
  const along = (row: number) =>
    (m[4 * row] as number) * x +
    (m[4 * row + 1] as number) * y +
    (m[4 * row + 2] as number) * z +
    (m[4 * row + 3] as number);
  const depth = along(2);
  if (depth <= 0) return false;
  const widened = 1 + 2 * margin;
  return Math.abs(along(0)) <= widened * across * depth && Math.abs(along(1)) <= widened * up * depth;
}

/** Gaussians by the cells of a grid; cells with equal hashes share a bucket. */
class Grid {
  private readonly mask: number;
  /** Where each bucket begins in `members`. */
  private readonly begins: Uint32Array;
  private readonly members: Uint32Array;
  /** Those around a Gaussian. */
  private readonly buckets = new Int32Array(27);

  constructor(
    private readonly centers: Float32Array,
    private readonly side: number,
  ) {
    const count = centers.length / 3;
    const numBuckets = 2 ** Math.ceil(Math.log2(Math.max(2, count)));
    this.mask = numBuckets - 1;
    this.begins = new Uint32Array(numBuckets + 1);
    this.members = new Uint32Array(count);
    const buckets = new Uint32Array(count);
    for (let i = 0; i < count; ++i) {
      const bucket = this.bucketOf(this.cell(i, 0), this.cell(i, 1), this.cell(i, 2));
      buckets[i] = bucket;
      this.begins[bucket + 1] = (this.begins[bucket + 1] as number) + 1;
    }
    for (let b = 0; b < numBuckets; ++b) {
      this.begins[b + 1] = (this.begins[b + 1] as number) + (this.begins[b] as number);
    }
    const next = this.begins.slice();
    for (let i = 0; i < count; ++i) {
      const bucket = buckets[i] as number;
      this.members[next[bucket] as number] = i;
      next[bucket] = (next[bucket] as number) + 1;
    }
  }

  /** Returns whether at least `least` others are within the side of a cell. */
  hasNeighbours(index: number, least: number): boolean {
    const { buckets, begins, members } = this;
    const [cx, cy, cz] = [this.cell(index, 0), this.cell(index, 1), this.cell(index, 2)];
    let found = 0;
    for (let step = 0; step < 27; ++step) {
      // The own cell first, which mostly is enough.
      const dx = ((step + 1) % 3) - 1;
      const dy = ((((step / 3) | 0) + 1) % 3) - 1;
      const dz = ((((step / 9) | 0) + 1) % 3) - 1;
      const bucket = this.bucketOf(cx + dx, cy + dy, cz + dz);
      // Cells of one bucket are counted once.
      buckets[step] = bucket;
      if (buckets.indexOf(bucket) < step) continue;
      const end = begins[bucket + 1] as number;
      for (let at = begins[bucket] as number; at < end; ++at) {
        const other = members[at] as number;
        if (other !== index && this.isNear(index, other) && ++found >= least) return true;
      }
    }
    return false;
  }

  private cell(index: number, axis: number): number {
    return Math.floor((this.centers[3 * index + axis] as number) / this.side);
  }

  private bucketOf(x: number, y: number, z: number): number {
    return (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791)) & this.mask;
  }

  private isNear(a: number, b: number): boolean {
    const { centers, side } = this;
    const dx = (centers[3 * a] as number) - (centers[3 * b] as number);
    const dy = (centers[3 * a + 1] as number) - (centers[3 * b + 1] as number);
    const dz = (centers[3 * a + 2] as number) - (centers[3 * b + 2] as number);
    return dx * dx + dy * dy + dz * dz <= side * side;
  }
}

/** Returns the floaters. Takes seconds for a million Gaussians: call it in a worker. */
export function floatersAmong(
  { centers, sizes }: Pick<GaussianPly, 'centers' | 'sizes'>,
  photographs: readonly SightOfPhotograph[],
): GaussianSet {
  const reach = reachOfNeighbours(centers);
  const grid = new Grid(centers, reach);
  const floaters = new Uint8Array(sizes.length);
  // Neighbours in a file mostly are in the sight of the same photograph.
  let last = 0;
  const isSeen = (i: number) => {
    const [x, y, z] = [centers[3 * i], centers[3 * i + 1], centers[3 * i + 2]] as [number, number, number];
    for (let step = 0; step < photographs.length; ++step) {
      const at = (last + step) % photographs.length;
      if (!sees(photographs[at] as SightOfPhotograph, x, y, z)) continue;
      last = at;
      return true;
    }
    return photographs.length === 0;
  };
  for (let i = 0; i < sizes.length; ++i) {
    const isLarge = (sizes[i] as number) > reach;
    const isAlone = !isLarge && !grid.hasNeighbours(i, minNeighbours);
    floaters[i] = isAlone || !isSeen(i) ? 1 : 0;
  }
  return floaters;
}
