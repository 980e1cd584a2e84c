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
  session.clear();
  try {
    await labels.create(text, mask);
  } catch (error) {
    if (!session.state.get().prompt) session.undo();
    throw error;
  }
}
