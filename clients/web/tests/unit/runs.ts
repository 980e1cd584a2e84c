// Masks for tests.
import type { Rle } from '../../app/mask/rle';

/**
 * Returns run lengths as pycocotools encodes them: the runs as they are, or as differences to the one
 * before the last, in groups of five bits from the lowest.
 */
export function encode(runs: number[]): string {
  return runs
    .map((run, i) => {
      let value = i > 2 ? run - (runs[i - 2] as number) : run;
      let text = '';
      for (;;) {
        const bits = value & 31;
        value >>= 5;
        const ends = (value === 0 && !(bits & 16)) || (value === -1 && !!(bits & 16));
        text += String.fromCharCode(48 + (ends ? bits : bits | 32));
        if (ends) return text;
      }
    })
    .join('');
}

/** Returns a mask of the first columns of a picture. */
export function firstColumns(count: number, width = 100, height = 10): Rle {
  const inside = count * height;
  return { width, height, counts: encode([0, inside, width * height - inside]) };
}
