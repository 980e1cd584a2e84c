// The masks that a prompt may mean, as the server proposes them.
import { segmentation } from '../api/clients';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import type { Proposal } from './answer';
import { proposalsOf } from './answer';
import { pointsFor } from './extend_prompt';
import { isMiss } from './miss';
import type { Prompt } from './prompt';
import { promptOf } from './prompt';

/** Returns the proposals for a prompt of clicks or strokes; undefined for others, which have none. */
export async function proposeSizes(
  model: string,
  prompt: Prompt,
  signal: AbortSignal,
): Promise<readonly Proposal[] | undefined> {
  const points = pointsFor(prompt);
  if (!points) return undefined;
  const request = { model, prompt: promptOf(points), maxProposals: 5 };
  try {
    return proposalsOf(
      await steadily(() => segmentation.proposeScales(request, { signal }), signal),
    );
  } catch (error) {
    // The middle of a stroke may be on nothing: then there are no sizes to choose from.
    if (isMiss(failureOf(error))) return [];
    throw error;
  }
}
