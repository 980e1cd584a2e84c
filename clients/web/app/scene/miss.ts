// Prompts that hit nothing.
import type { Failure } from '../api/failure';
import { middleOf } from '../mask/rle';
import type { Place, Prompt } from './prompt';

/** A click, the middle of a box or a mask, or the end of a stroke that hit nothing: pixels of its view. */
export interface Miss {
  readonly place: Place;
  readonly x: number;
  readonly y: number;
}

export function isMiss(failure: Failure): boolean {
  return failure.reason === 'NOTHING_THERE';
}

/** Returns the position of a prompt that got no answer. */
export function missOf(prompt: Prompt): Miss | undefined {
  if (!('place' in prompt)) return undefined;
  const { place } = prompt;
  if (prompt.kind === 'box') {
    const { x, y, width, height } = prompt.box;
    return { place, x: x + width / 2, y: y + height / 2 };
  }
  if (prompt.kind === 'mask') return { place, ...middleOf(prompt.rle) };
  const last =
    prompt.kind === 'points' ? prompt.points.at(-1) : prompt.strokes.at(-1)?.path.at(-1);
  return last && { place, x: last.x, y: last.y };
}
