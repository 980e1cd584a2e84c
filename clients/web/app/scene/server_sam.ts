// Whether the server has SAM.
import { ConnectError } from '@connectrpc/connect';
import { detailOf } from '../../contract/error_detail';
import { segmentation } from '../api/clients';
import { steadily } from '../api/server_link';

/**
 * Returns whether the server can let SAM place borders. The contract lists nowhere what a server can
 * do, so this asks for SAM's borders without a prompt: a server without SAM refuses that as NO_SAM,
 * others refuse the missing prompt. Nothing is segmented. The answer holds until the server's restart.
 */
export async function serverHasSam(model: string, signal: AbortSignal): Promise<boolean> {
  const request = { model, samBorders: true };
  try {
    await steadily(() => segmentation.segmentViews(request, { signal }), signal);
  } catch (error) {
    const reason = detailOf(ConnectError.from(error))?.reason;
    if (reason === undefined) throw error;
    return reason !== 'NO_SAM';
  }
  return true;
}
