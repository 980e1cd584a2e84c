// COCO's run lengths (column-major, first the zeros), compressed to a string: five bits a character
// from '0' on, and a sixth that says that more follow. From the third run on each number is the
// difference to the one two before it.
export interface Rle {
  readonly height: number;
  readonly width: number;
  readonly counts: string;
}

export function runsOf(counts: string): number[] {
  const runs: number[] = [];
  for (let at = 0; at < counts.length;) {
    let value = 0;
    let shift = 0;
    let bits: number;
    do {
      bits = counts.charCodeAt(at++) - 48;
      if (!(bits >= 0 && bits < 64)) throw new Error('a character that no run length has');
      value |= (bits & 31) << shift;
      shift += 5;
    } while (bits & 32);
    if (bits & 16) value |= -1 << shift;
    runs.push(runs.length > 2 ? value + (runs[runs.length - 2] as number) : value);
  }
  return runs;
}

/** Pixels in row-major order, one byte each: 0 or 1. */
export function decodeRle({ height, width, counts }: Rle): Uint8Array {
  const pixels = new Uint8Array(width * height);
  let position = 0;
  runsOf(counts).forEach((run, index) => {
    const end = Math.min(position + run, pixels.length);
    if (index % 2 === 1) fillColumns(pixels, position, end, height, width);
    position = end;
  });
  return pixels;
}

function fillColumns(
  pixels: Uint8Array,
  from: number,
  to: number,
  height: number,
  width: number,
): void {
  let row = from % height;
  let column = (from - row) / height;
  for (let i = from; i < to; ++i) {
    pixels[row * width + column] = 1;
    if (++row < height) continue;
    row = 0;
    ++column;
  }
}

/** Returns the position, column by column, of the pixel of a mask that has `count` others before it. */
function positionOf(runs: readonly number[], count: number): number {
  let left = count;
  let position = 0;
  for (const [i, run] of runs.entries()) {
    if (i % 2 === 1 && left < run) return position + left;
    if (i % 2 === 1) left -= run;
    position += run;
  }
  return position;
}

/** Returns the number of the mask's pixels before a position. */
function countBefore(runs: readonly number[], position: number): number {
  let at = 0;
  let count = 0;
  for (const [i, run] of runs.entries()) {
    if (i % 2 === 1) count += Math.min(run, Math.max(position - at, 0));
    at += run;
  }
  return count;
}

/**
 * Returns a pixel in the middle of a mask: the middle one of the column that has half of the mask on
 * either side. Stray pixels hardly move it.
 */
export function middleOf({ height, counts }: Rle): { readonly x: number; readonly y: number } {
  const runs = runsOf(counts);
  const area = countBefore(runs, Infinity);
  const x = Math.floor(positionOf(runs, Math.floor(area / 2)) / height);
  const above = countBefore(runs, x * height);
  const inColumn = countBefore(runs, (x + 1) * height) - above;
  return { x, y: positionOf(runs, above + Math.floor(inColumn / 2)) - x * height };
}

export interface Extent {
  /** Number of pixels in the mask. */
  readonly area: number;
  /** Smallest box around them: x, y, width, height; all 0 for an empty mask. */
  readonly box: readonly number[];
}

export function extentOf(mask: Rle): Extent {
  const pixels = decodeRle(mask);
  let area = 0;
  let [left, top, right, bottom] = [mask.width, mask.height, 0, 0];
  for (let y = 0, i = 0; y < mask.height; ++y) {
    for (let x = 0; x < mask.width; ++x, ++i) {
      if (!pixels[i]) continue;
      ++area;
      left = Math.min(left, x);
      right = Math.max(right, x + 1);
      top = Math.min(top, y);
      bottom = y + 1;
    }
  }
  return { area, box: area === 0 ? [0, 0, 0, 0] : [left, top, right - left, bottom - top] };
}

/**
 * Returns the IoU of two masks of one size from their run lengths, without their pixels, which take
 * a tenth of a second for large photographs. 0 for other sizes and empty masks.
 */
export function overlapOf(a: Rle, b: Rle): number {
  if (a.width !== b.width || a.height !== b.height) return 0;
  const runs = [runsOf(a.counts), runsOf(b.counts)] as const;
  const at = [0, 0];
  const left = [runs[0][0] ?? 0, runs[1][0] ?? 0];
  let both = 0;
  let either = 0;
  while ((at[0] as number) < runs[0].length && (at[1] as number) < runs[1].length) {
    const step = Math.min(left[0] as number, left[1] as number);
    const inside = [0, 1].filter((i) => (at[i] as number) % 2 === 1).length;
    if (inside === 2) both += step;
    if (inside > 0) either += step;
    for (const i of [0, 1] as const) {
      left[i] = (left[i] as number) - step;
      if (left[i] === 0) left[i] = runs[i][(at[i] = (at[i] as number) + 1)] ?? 0;
    }
  }
  return either === 0 ? 0 : both / either;
}

/** Returns the IoU: pixels in both masks over pixels in either. */
export function intersectionOverUnion(a: Uint8Array, b: Uint8Array): number {
  let both = 0;
  let either = 0;
  for (let i = 0; i < a.length; ++i) {
    both += a[i] && b[i] ? 1 : 0;
    either += a[i] || b[i] ? 1 : 0;
  }
  return either === 0 ? 0 : both / either;
}
