// Encodes masks as COCO's run lengths: see rle.ts.
import type { Rle } from './rle';

function countsOf(runs: readonly number[]): string {
  const codes: number[] = [];
  runs.forEach((run, i) => {
    let value = i > 2 ? run - (runs[i - 2] as number) : run;
    for (;;) {
      const bits = value & 31;
      value >>= 5;
      const ends = value === (bits & 16 ? -1 : 0);
      codes.push(48 + (ends ? bits : bits | 32));
      if (ends) break;
    }
  });
  return codes.map((code) => String.fromCharCode(code)).join('');
}

/** Returns a mask of the pixels for which `isInside` holds. */
export function encodeRle(
  width: number,
  height: number,
  isInside: (x: number, y: number) => boolean,
): Rle {
  const runs: number[] = [];
  let isOne = false;
  let run = 0;
  for (let x = 0; x < width; ++x) {
    for (let y = 0; y < height; ++y) {
      if (isInside(x, y) !== isOne) {
        runs.push(run);
        run = 0;
        isOne = !isOne;
      }
      ++run;
    }
  }
  runs.push(run);
  return { width, height, counts: countsOf(runs) };
}
