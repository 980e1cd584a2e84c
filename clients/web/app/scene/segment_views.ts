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

export interface ViewsQuery {
  readonly model: string;
  readonly prompt: Prompt;
  readonly granularity: Granularity;
  readonly views: readonly string[];
  /** Whether SAM places the borders. */
  readonly samBorders?: boolean;
}

/** Segments the named views in one request, which is repeated until the server answers. */
export async function segmentViews(query: ViewsQuery, signal: AbortSignal): Promise<Answer> {
  const { model, prompt, granularity, views, samBorders = false } = query;
  const request = { ...segmentRequest(model, prompt, granularity, views), samBorders };
  return answerOf(await steadily(() => segmentation.segmentViews(request, { signal }), signal));
}
