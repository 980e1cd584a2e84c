// Segments views a few at a time, so that masks come as they are made: a request for all of them is
// answered when the last one is done, and may exceed the largest answer.
import { segmentation } from '../api/clients';
import { steadily } from '../api/server_link';
import type { Answer } from './answer';
import { answerOf } from './answer';
import type { Granularity, Prompt } from './prompt';
import { segmentRequest } from './prompt';

const firstBatch = 2;

/**
 * Cuts a list of views into batches of at most `largest` views: small ones first, because somebody
 * waits for the first mask.
 */
export function batchesOf(views: readonly string[], largest = 8): string[][] {
  const batches: string[][] = [];
  for (let at = 0, size = firstBatch; at < views.length; at += size, size *= 2) {
    size = Math.min(size, largest);
    batches.push(views.slice(at, at + size));
  }
  return batches;
}

/** Views in a request in which SAM answers: it takes a second or two of a core for each new view. */
export const samBatch = 2;

/**
 * Cuts the views that SAM has not answered yet into batches: first the prompt's view, in which SAM sees
 * the clicks, with the shown one, then the others. undefined: the picture of the 3D view (`own` is empty).
 */
export function samBatches(
  own: string,
  shown: string,
  views: readonly string[],
  answered: ReadonlyMap<string, unknown>,
): (string[] | undefined)[] {
  const left = [...new Set([own, shown, ...views])].filter((view) => view && !answered.has(view));
  const onScreen = left.filter((view) => view === own || view === shown);
  const rest = batchesOf(left.slice(onScreen.length), samBatch);
  const named = onScreen.length > 0 ? [onScreen, ...rest] : rest;
  return own === '' && !answered.has('') ? [undefined, ...named] : named;
}

/** Whether SAM and the model answer clicks and boxes together; auto: as the server does for the model. */
export type SamClicks = 'auto' | 'on' | 'off';

const samField = { auto: undefined, on: true, off: false } as const;

export interface ViewsQuery {
  readonly model: string;
  readonly prompt: Prompt;
  readonly granularity: Granularity;
  /** Absent: the prompt's view. */
  readonly views?: readonly string[] | undefined;
  /** Whether SAM places the borders. Absent: as the server does for the model. */
  readonly samBorders?: boolean | undefined;
  /** Absent: off. Others are for points or a box without scale and threshold. */
  readonly samClicks?: SamClicks;
}

/** Segments the named views in one request, which is repeated until the server answers. */
export async function segmentViews(query: ViewsQuery, signal: AbortSignal): Promise<Answer> {
  const { model, prompt, granularity, views, samBorders } = query;
  const samClicks = samField[query.samClicks ?? 'off'];
  const request = {
    ...segmentRequest(model, prompt, granularity, views),
    ...(samBorders !== undefined && { samBorders }),
    ...(samClicks !== undefined && { samClicks }),
  };
  return answerOf(await steadily(() => segmentation.segmentViews(request, { signal }), signal));
}
