// The mask that a person accepted by naming it. In the label's own view it is the answer, not what the
// model makes of it.
import { Code, ConnectError } from '@connectrpc/connect';
import type { Label } from '../../gen/pepeseg/v1/label_service_pb';
import { labels } from '../api/clients';
import { steadily } from '../api/server_link';
import { extentOf } from '../mask/rle';
import type { Mask } from './answer';

function maskOfLabel({ view, mask }: Label): Mask | undefined {
  if (mask?.image.case !== 'rle') return undefined;
  const { height, width, counts } = mask.image.value;
  const rle = { height, width, counts };
  return { view, rle, ...extentOf(rle), score: 1 };
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
