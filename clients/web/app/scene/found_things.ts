// The things that the server found by a word or by their looks, as the screen shows them.
import type { FindSegmentsResponse } from '../../gen/pepeseg/v1/find_pb';
import { FindSegmentsResponse_Source as Source } from '../../gen/pepeseg/v1/find_pb';
import { lastId } from '../api/clients';
import type { Granularity, Prompt } from './prompt';

/** A box around a thing in a view, pixels. */
export interface Appearance {
  readonly view: string;
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

export interface FoundThing {
  readonly name: string;
  /** In [0, 1]. */
  readonly score: number;
  readonly prompt: Prompt;
  readonly granularity: Granularity;
  /** The largest first. */
  readonly appearances: readonly Appearance[];
}

export interface FoundThings {
  readonly things: readonly FoundThing[];
  /** How they were found; empty if nothing was. */
  readonly source: string;
  /** The best score below the minimum, and its word; 0 and empty if something was found. */
  readonly bestScore: number;
  readonly bestWord: string;
  readonly didYouMean: readonly string[];
  readonly knownWords: readonly string[];
}

const sources: Record<Source, string> = {
  [Source.UNSPECIFIED]: '',
  [Source.LABELS]: 'by the names of labels',
  [Source.DETECTOR]: 'by a detector, in the photographs',
  [Source.TEXT_COMMAND]: 'by the server’s text program, in the photographs',
  [Source.APPEARANCE]: 'by how they look in the photographs',
};

type Found = FindSegmentsResponse['found'][number];

function granularityIn({ granularity }: Found): Granularity {
  if (!granularity) return {};
  const { scale, threshold } = granularity;
  return { ...(scale.case === 'scaleQuantile' && { scale: scale.value }), threshold };
}

function thingIn(found: Found): FoundThing[] {
  const { label, word, score, prompt, appearances } = found;
  const name = word || (label && lastId(label));
  if (label && (!prompt || prompt.what.case === 'label')) {
    // As a label: in its own view the accepted mask is the answer.
    return [{ name, score, prompt: { kind: 'label', label }, granularity: {}, appearances }];
  }
  if (!prompt) return [];
  const granularity = granularityIn(found);
  return [{ name, score, prompt: { kind: 'found', message: prompt }, granularity, appearances }];
}

export function foundIn(response: FindSegmentsResponse): FoundThings {
  const { found, source, bestScore, bestWord, didYouMean, knownWords } = response;
  const things = found.flatMap(thingIn);
  return { things, source: sources[source] ?? '', bestScore, bestWord, didYouMean, knownWords };
}

/** Describes what was found, by a word or (`word` empty) by its looks. */
export function describeFound(
  { things, source, bestScore, bestWord }: FoundThings,
  word: string,
): string {
  if (things.length > 0) {
    const count = things.length === 1 ? '1 thing' : `${things.length} things`;
    return `${count}, ${source}.`;
  }
  if (!word) return 'Nothing else looks like it.';
  const best = bestScore > 0 ? ` (best: ${bestWord && `${bestWord}, `}${bestScore.toFixed(2)})` : '';
  return `No “${word}” here${best}.`;
}

/** Colours of found things, red, green and blue: most people can distinguish them. Then they repeat. */
const palette = [
  [230, 159, 0],
  [86, 180, 233],
  [0, 158, 115],
  [240, 228, 66],
  [204, 121, 167],
  [213, 94, 0],
  [0, 114, 178],
  [148, 103, 189],
  [140, 86, 75],
  [188, 189, 34],
  [255, 152, 150],
  [23, 190, 207],
] as const;

export type Rgb = readonly [red: number, green: number, blue: number];

export function colorOf(index: number): Rgb {
  return palette[index % palette.length] as Rgb;
}
