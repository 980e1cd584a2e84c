// The current segment as a thing whose masks are exported, and masks of things in every view.
import type { Label } from '../../gen/pepeseg/v1/label_service_pb';
import { lastId } from '../api/clients';
import type { ViewMasks } from '../mask/coco';
import { acceptedFor } from './accepted_mask';
import type { Mask } from './answer';
import { labelName } from './labels';
import type { Granularity, Prompt } from './prompt';
import type { Watch } from './running_task';
import type { SamClicks } from './segment_views';
import { batchesOf, samBatch, segmentViews } from './segment_views';
import { serverHasSam } from './server_sam';
import type { SessionState } from './session_state';
import { granularityElsewhere, isForSam } from './session_state';

export interface Thing {
  /** Id of the label, which is a folder's name. */
  readonly id: string;
  readonly category: string;
  readonly prompt: Prompt;
  readonly granularity: Granularity;
  /** Absent: off. */
  readonly samClicks?: SamClicks;
}

/** Returns the current segment as a thing, by its label if it has one; undefined: there is none. */
export function thingOf(
  labels: readonly Label[],
  state: Pick<SessionState, 'prompt' | 'granularity' | 'answer' | 'samClicks'>,
): Thing | undefined {
  const { prompt, answer } = state;
  if (!prompt || !answer) return undefined;
  const label = prompt.kind === 'label' && labels.find(({ name }) => name === prompt.label);
  if (label) return { id: lastId(label.name), category: labelName(label), prompt, granularity: {} };
  const samClicks = isForSam(state) ? state.samClicks : 'off';
  const granularity = granularityElsewhere(state);
  return { id: 'segment', category: 'segment', prompt, granularity, samClicks };
}

/** Masks of a thing while they are made. */
interface Making {
  readonly thing: Thing;
  readonly accepted: Mask | undefined;
  readonly masks: Map<string, Mask>;
  /** The server chooses for the first views; the others get the same, except for clicks. */
  granularity: Granularity;
}

async function begun(thing: Thing, signal: AbortSignal): Promise<Making> {
  const { prompt, granularity } = thing;
  const accepted = await acceptedFor(prompt, signal);
  return { thing, accepted, masks: new Map(), granularity };
}

/** Adds the masks of some views; in a label's own view that is the accepted one. */
async function addMasks(
  making: Making,
  asked: { readonly model: string; readonly views: readonly string[] },
  signal: AbortSignal,
): Promise<void> {
  const { thing, accepted, masks, granularity } = making;
  const views = asked.views.filter((view) => view !== accepted?.view);
  if (accepted && views.length < asked.views.length) masks.set(accepted.view, accepted);
  if (views.length === 0) return;
  const { prompt, samClicks = 'off' } = thing;
  const query = { ...asked, prompt, granularity, views, samClicks };
  const answer = await segmentViews(query, signal);
  for (const [view, mask] of answer.masks) masks.set(view, mask);
  if (samClicks === 'off' && prompt.kind !== 'points') {
    making.granularity = { scale: answer.scale, threshold: answer.threshold };
  }
}

/**
 * Returns the masks of each thing in each view, in the order of the views. SAM places their borders where
 * the server lets it. Goes through the views outside and the things inside, since SAM reads a view once.
 */
export async function masksOfThings(
  model: string,
  things: readonly Thing[],
  views: readonly string[],
  { progress, signal }: Watch,
): Promise<ViewMasks[]> {
  const total = things.length * views.length;
  progress(0, total);
  const hasSam = await serverHasSam(model, signal);
  const all = await Promise.all(things.map((thing) => begun(thing, signal)));
  let done = 0;
  for (const batch of batchesOf(views, hasSam ? samBatch : undefined)) {
    for (const making of all) {
      await addMasks(making, { model, views: batch }, signal);
      progress((done += batch.length), total);
    }
  }
  return all.map(({ thing: { id, category }, masks }) => ({
    id,
    category,
    masks: views.flatMap((view) => masks.get(view) ?? []),
  }));
}
