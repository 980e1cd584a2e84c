import type { Mask } from './answer';
import type { SceneLabels } from './labels';
import type { SceneSession } from './session';

/**
 * Makes a label of the mask and ends the segment, so that the next click begins another one. If the
 * label cannot be made, the segment comes back, unless another one was begun. Throws the server's error.
 */
export async function nameSegment(
  session: SceneSession,
  labels: SceneLabels,
  text: string,
  mask: Mask,
): Promise<void> {
  const { history } = session;
  const cleared = session.clear();
  try {
    history.join(cleared, await labels.create(text, mask));
  } catch (error) {
    if (history.isNewest(cleared)) await history.undo();
    throw error;
  }
}
