// The segments of a decomposition: their levels, colours and masks.
import type { DecomposeModelResponse } from '../../gen/pepeseg/v1/decomposition_pb';
import { encodeRle } from '../mask/encode_rle';
import type { GreyPicture } from '../mask/grey_png';
import type { Rle } from '../mask/rle';
import type { Rgb } from './found_things';
import type { Size } from './photo_frame';

/** Index of a level of the decomposition at the default scales. */
export type Level = 0 | 1 | 2;

export const levelNames = ['Part', 'Object', 'Group'] as const;

/** A segment: its level, and its id there, from 1. */
export interface SegmentId {
  readonly level: Level;
  readonly id: number;
}

export interface Decomposition {
  /** Gaussians of each segment of each level, by its id - 1. */
  readonly numGaussians: readonly (readonly number[])[];
}

/** A segment in a view. */
export interface SeenSegment {
  readonly id: number;
  /** Pixels of the picture of ids. */
  readonly area: number;
}

export function decompositionOf({ levels }: DecomposeModelResponse): Decomposition {
  return {
    numGaussians: levels.map(({ segments }) =>
      segments.map(({ numGaussians }) => Number(numGaussians)),
    ),
  };
}

export function sameSegment(a: SegmentId | undefined, b: SegmentId | undefined): boolean {
  return a !== undefined && b !== undefined && a.level === b.level && a.id === b.id;
}

/** Returns the name of a segment for people: "Object 12". */
export function segmentName({ level, id }: SegmentId): string {
  return `${levelNames[level]} ${id}`;
}

/**
 * Returns the colour of a segment, the same in all views, as in the pictures of `pepeseg decompose`: steps
 * of the hue by the golden ratio spread any number of ids evenly.
 */
export function segmentColor(id: number): Rgb {
  const hue = ((0.618033988749895 * id) % 1) * 6;
  const saturation = id % 2 === 0 ? 0.85 : 0.55;
  const value = [1, 0.75, 0.9][id % 3] as number;
  const part = (offset: number) => {
    const k = (offset + hue) % 6;
    const share = value - value * saturation * Math.max(0, Math.min(k, 4 - k, 1));
    return Math.round(255 * share);
  };
  return [part(5), part(3), part(1)];
}

/** Returns the id at a position of a view whose size is `size`; 0: no segment. */
export function idAt(picture: GreyPicture, size: Size, x: number, y: number): number {
  const column = Math.floor((x / size.width) * picture.width);
  const row = Math.floor((y / size.height) * picture.height);
  return picture.values[row * picture.width + column] ?? 0;
}

/** Returns the mask of a segment in a view of this size, which may be larger than the picture. */
export function maskOfSegment(picture: GreyPicture, size: Size, id: number): Rle {
  return encodeRle(size.width, size.height, (x, y) => idAt(picture, size, x + 0.5, y + 0.5) === id);
}

/** Returns the segments in a picture, the largest first. */
export function seenSegments({ values }: GreyPicture): SeenSegment[] {
  const areas = new Map<number, number>();
  for (const id of values) areas.set(id, (areas.get(id) ?? 0) + 1);
  areas.delete(0);
  return [...areas]
    .map(([id, area]) => ({ id, area }))
    .sort((a, b) => b.area - a.area || a.id - b.id);
}
