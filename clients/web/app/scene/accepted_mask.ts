// The mask that a person accepted, by naming it or as it was drawn. In its own view it is the answer, not
// what the model makes of it.
import { Code, ConnectError } from '@connectrpc/connect';
import type { Label } from '../../gen/pepeseg/v1/label_service_pb';
import { labels } from '../api/clients';
import { steadily } from '../api/server_link';
import type { Rle } from '../mask/rle';
import { extentOf } from '../mask/rle';
import type { Answer, Mask } from './answer';
import type { Prompt } from './prompt';

function maskIn(view: string, rle: Rle): Mask {
  return { view, rle, ...extentOf(rle), score: 1 };
}

function maskOfLabel({ view, mask }: Label): Mask | undefined {
  if (mask?.image.case !== 'rle') return undefined;
  const { height, width, counts } = mask.image.value;
  return maskIn(view, { height, width, counts });
}

/** Returns the mask of a prompt that is accepted as it is; undefined for other prompts. */
export function exactMask(prompt: Prompt): Mask | undefined {
  if (prompt.kind !== 'mask' || !prompt.isExact) return undefined;
  return maskIn(prompt.place.view, prompt.rle);
}

const noAnswer: Answer = {
  masks: new Map(),
  scale: 0.5,
  scaleUnits: 0,
  threshold: 0.5,
  computeMs: 0,
};

/** Returns an answer with the mask, until the server says more. `before`: the answer that it changes. */
export function answerWith(mask: Mask, before: Answer = noAnswer): Answer {
  return { ...before, masks: new Map([...before.masks, [mask.view, mask]]) };
}

/** Returns the accepted mask of a label; undefined if the live model does not have its view. */
export async function acceptedMask(label: string, signal: AbortSignal): Promise<Mask | undefined> {
  try {
    return maskOfLabel(await steadily(() => labels.getLabel({ name: label }, { signal }), signal));
  } catch (error) {
    if (ConnectError.from(error).code === Code.FailedPrecondition) return undefined;
    throw error;
  }
}

/** Returns the mask that a person accepted for a prompt, which its own view shows; undefined: none. */
export async function acceptedFor(prompt: Prompt, signal: AbortSignal): Promise<Mask | undefined> {
  return prompt.kind === 'label' ? acceptedMask(prompt.label, signal) : exactMask(prompt);
}
