// Adds a click or a stroke to a prompt. In one view they are about one thing: a stroke after clicks
// makes dots of them, and a click after strokes is a dot.
import type { Rle } from '../mask/rle';
import { decodeRle } from '../mask/rle';
import type { Place, Point, Prompt, Stroke } from './prompt';
import { placeOf, samePlace } from './prompt';

/** Why a prompt cannot be extended, and what to do. */
export interface Refusal {
  readonly what: string;
  readonly todo: string;
}

const maxPoints = 64;
/** Maximum number of vertices of all strokes. */
const maxVertices = 4096;

function dotOf({ x, y, negative }: Point): Stroke {
  return { path: [{ x, y }], negative, width: 0 };
}

function strokesOf(prompt: Prompt | undefined): readonly Stroke[] {
  if (prompt?.kind === 'scribbles') return prompt.strokes;
  return prompt?.kind === 'points' ? prompt.points.map(dotOf) : [];
}

const nothingIncluded = {
  what: 'Nothing is included yet.',
  todo: 'Mark what is meant first, then what is not.',
};

/** Returns the prompt with one more stroke; a prompt of another place or kind ends. */
export function withStroke(
  prompt: Prompt | undefined,
  place: Place,
  stroke: Stroke,
): Prompt | Refusal {
  const before = samePlace(placeOf(prompt), place) ? strokesOf(prompt) : [];
  const strokes = [...before, stroke];
  if (strokes.every(({ negative }) => negative)) return nothingIncluded;
  if (strokes.reduce((sum, { path }) => sum + path.length, 0) > maxVertices) {
    return { what: 'The strokes together are too long.', todo: 'Draw fewer or shorter ones.' };
  }
  return { kind: 'scribbles', place, strokes };
}

/** Returns the prompt with one more point; a prompt of another place or kind ends. */
export function withPoint(
  prompt: Prompt | undefined,
  place: Place,
  point: Point,
): Prompt | Refusal {
  const goesOn = samePlace(placeOf(prompt), place);
  if (goesOn && prompt?.kind === 'scribbles') return withStroke(prompt, place, dotOf(point));
  const points = goesOn && prompt?.kind === 'points' ? [...prompt.points, point] : [point];
  if (points.every(({ negative }) => negative)) return nothingIncluded;
  if (points.length > maxPoints) {
    return { what: `A prompt has at most ${maxPoints} points.`, todo: 'Clear it and start again.' };
  }
  return { kind: 'points', place, points };
}

export function isRefusal(extended: Prompt | Refusal): extended is Refusal {
  return 'what' in extended;
}

/** Returns whether `next` is about the same thing as `before`, with one mark more. */
export function isExtended(before: Prompt | undefined, next: Prompt): boolean {
  if (next.kind !== 'points' && next.kind !== 'scribbles') return false;
  return samePlace(placeOf(before), next.place) && strokesOf(next).length > 1;
}

/** A mark this near to the border of a mask, in pixels, is on either side of it. */
const slack = 1;

/**
 * Returns whether the mask contains the positive marks of the prompt, and not the negative ones. Of a
 * stroke, which may slip over the border, most vertices count.
 */
export function agreesWith(mask: Rle, prompt: Prompt): boolean {
  const { width, height } = mask;
  const pixels = decodeRle(mask);
  const clamp = (value: number, end: number) => Math.min(Math.max(Math.floor(value), 0), end - 1);
  const isOnItsSide = (x: number, y: number, negative: boolean) => {
    for (let dy = -slack; dy <= slack; ++dy) {
      for (let dx = -slack; dx <= slack; ++dx) {
        const inside = pixels[clamp(y + dy, height) * width + clamp(x + dx, width)] === 1;
        if (inside !== negative) return true;
      }
    }
    return false;
  };
  return strokesOf(prompt).every(({ path, negative }) => {
    const right = path.filter(({ x, y }) => isOnItsSide(x, y, negative));
    return right.length * 2 > path.length;
  });
}

/**
 * Returns the prompt as points, which is what the server proposes sizes for: of a stroke its middle.
 * Undefined for a prompt that is not made of marks.
 */
export function pointsFor(prompt: Prompt): Prompt | undefined {
  if (prompt.kind === 'points') return prompt;
  if (prompt.kind !== 'scribbles') return undefined;
  const points = prompt.strokes.flatMap(({ path, negative }) => {
    const middle = path[Math.floor(path.length / 2)];
    return middle ? [{ ...middle, negative }] : [];
  });
  // The newest marks, but the first one that is included stays.
  const first = points.findIndex(({ negative }) => !negative);
  const kept = points.filter((_, i) => i === first || i > points.length - maxPoints);
  return { kind: 'points', place: prompt.place, points: kept };
}
