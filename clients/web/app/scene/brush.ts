// The brush: how it draws, and the strokes that it makes.
import type { Spot } from './marks';
import { drawingWidth } from './marks';
import type { Stroke } from './prompt';
import { maxStrokeWidth } from './prompt';

export interface Brush {
  /** Whether it draws over what is not meant. */
  readonly negative: boolean;
  /** In units of the drawing over a view, `drawingWidth` of which are as wide as the view. */
  readonly width: number;
}

export const minBrush = 2;
export const maxBrush = 40;
export const firstBrush: Brush = { negative: false, width: 8 };

export function withWidth(brush: Brush, width: number): Brush {
  return { ...brush, width: Math.min(Math.max(width, minBrush), maxBrush) };
}

/** Returns the width of strokes, pixels, in a view that is `viewWidth` pixels wide. */
export function strokeWidth({ width }: Brush, viewWidth: number): number {
  return Math.min((width * viewWidth) / drawingWidth, maxStrokeWidth);
}

/** Steps of a stroke that are shorter than this, in units of the drawing, are left out. */
const shortest = 2;

/** Returns the stroke with one vertex more, unless that is too near to the last one. */
export function continued(stroke: Stroke, { x, y }: Spot, viewWidth: number): Stroke {
  const last = stroke.path.at(-1);
  const step = last ? Math.hypot(x - last.x, y - last.y) : Infinity;
  if (step < (shortest * viewWidth) / drawingWidth) return stroke;
  return { ...stroke, path: [...stroke.path, { x, y }] };
}
