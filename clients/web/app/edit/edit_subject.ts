// The thing that an edit is about, and the selection that stands for it while the edit is made.
import type { MessageInitShape } from '@bufbuild/protobuf';
import type { SubsetSchema } from '../../gen/pepeseg/v1/render_service_pb';
import type {
  CreateSelectionRequestSchema,
  Selection,
} from '../../gen/pepeseg/v1/selection_service_pb';
import { newRequestId, selections } from '../api/clients';
import { steadily } from '../api/server_link';
import type { GaussianSet } from '../gaussians/gaussian_set';
import { bitsOf } from '../gaussians/gaussian_set';
import type { Granularity, Prompt } from '../scene/prompt';
import { granularityOf } from '../scene/prompt';
import { sourceOf } from '../scene/selections';

export type EditSubject =
  /** Gaussians that were picked in 3D. */
  | { readonly kind: 'picked'; readonly set: GaussianSet }
  /** The answer to a prompt. */
  | { readonly kind: 'segment'; readonly prompt: Prompt; readonly granularity: Granularity }
  | { readonly kind: 'selection'; readonly selection: string };

export type SubsetOf = NonNullable<MessageInitShape<typeof SubsetSchema>['of']>;

type SelectionRequest = MessageInitShape<typeof CreateSelectionRequestSchema>;

/** Returns what selects the subject, but for the model. */
function requestFor(subject: Exclude<EditSubject, { kind: 'selection' }>): SelectionRequest {
  if (subject.kind === 'picked') {
    return { source: { case: 'gaussians', value: { bits: bitsOf(subject.set) } } };
  }
  const { prompt, granularity } = subject;
  return { source: sourceOf(prompt), granularity: granularityOf(granularity) };
}

/** Makes a selection of the subject for as long as `act` takes. Throws the server's errors. */
async function whileSelected<T>(
  model: string,
  subject: EditSubject,
  signal: AbortSignal,
  act: (selection: Pick<Selection, 'name'>) => Promise<T>,
): Promise<T> {
  if (subject.kind === 'selection') return act({ name: subject.selection });
  const request = { ...requestFor(subject), model, requestId: newRequestId() };
  const made = await steadily(() => selections.createSelection(request, { signal }), signal);
  try {
    signal.throwIfAborted();
    return await act(made);
  } finally {
    selections.deleteSelection({ name: made.name }).catch(() => undefined);
  }
}

/** Calls `act` with a subset of the subject, which is there until `act` ends. */
export function withSubset<T>(
  model: string,
  subject: EditSubject,
  signal: AbortSignal,
  act: (of: SubsetOf) => Promise<T>,
): Promise<T> {
  const segment =
    subject.kind === 'segment' && subject.prompt.kind === 'mask' && subject.prompt.segment;
  if (segment) return act({ case: 'segment', value: { ...segment } });
  return whileSelected(model, subject, signal, ({ name }) => act({ case: 'selection', value: name }));
}

/** Returns the bits of a selection, as in GaussianBits. */
export async function bitsOfSelection(name: string, signal?: AbortSignal): Promise<Uint8Array> {
  const ask = () => selections.getSelection({ name, wantGaussians: true }, signal ? { signal } : {});
  return (await steadily(ask, signal)).gaussians?.bits ?? new Uint8Array();
}

/** Returns the bits of the subject's Gaussians. */
export function bitsOfSubject(
  model: string,
  subject: EditSubject,
  signal: AbortSignal,
): Promise<Uint8Array> {
  return whileSelected(model, subject, signal, ({ name }) => bitsOfSelection(name, signal));
}
