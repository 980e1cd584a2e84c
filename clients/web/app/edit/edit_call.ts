// One call of EditModel: its progress, and its result.
import type { MessageInitShape } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import type {
  EditModelRequestSchema,
  EditModelResponse_Result,
} from '../../gen/pepeseg/v1/edit_service_pb';
import { editing } from '../api/clients';
import { serverAnswers } from '../api/server_link';
import type { Steps } from '../scene/running_task';

export type EditRequest = MessageInitShape<typeof EditModelRequestSchema> & {
  readonly model: string;
};

function sentenceCase(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** Makes an edit. It is not repeated when the connection is lost, since a repeated call makes another model. */
export async function editModel(
  request: EditRequest,
  steps: Steps,
  signal: AbortSignal,
): Promise<EditModelResponse_Result> {
  steps('Editing', 'steps').progress(0, 0);
  for await (const { part } of editing.editModel(request, { signal })) {
    serverAnswers();
    if (part.case === 'result') return part.value;
    if (part.case !== 'progress') continue;
    const { activity, numDone, numAll } = part.value;
    steps(sentenceCase(activity), 'steps').progress(Number(numDone), Number(numAll));
  }
  throw new ConnectError('the edit ended without a result', Code.DataLoss);
}
