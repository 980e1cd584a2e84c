// Masks that are shown in place of the model's: the one that a person accepted, and SAM's borders.
import type { Store } from '../store';
import { acceptedMask, exactMask } from './accepted_mask';
import type { Answer } from './answer';
import type { Prompt } from './prompt';
import { isIn3d } from './prompt';
import { segmentViews } from './segment_views';
import type { SessionState } from './session_state';
import { granularityElsewhere } from './session_state';

/** The session whose masks are replaced. */
export interface Keeper {
  readonly model: string;
  readonly state: Store<SessionState>;
  shown(): string;
  /** Shows the masks until the prompt, scale or threshold changes. */
  keep(masks: Answer['masks']): void;
  /** Called with what ended a request, and its signal. */
  report(error: unknown, signal: AbortSignal): void;
}

export class KeptMasks {
  private running = new AbortController();

  constructor(private readonly keeper: Keeper) {}

  stop(): void {
    this.running.abort();
    this.running = new AbortController();
  }

  /** Keeps the mask that a person accepted for the prompt, if there is one: in its own view it is the answer. */
  async keepAccepted(prompt: Prompt): Promise<void> {
    const exact = exactMask(prompt);
    if (exact) this.keeper.keep(new Map([[exact.view, exact]]));
    if (prompt.kind !== 'label') return;
    const { signal } = this.running;
    try {
      const mask = await acceptedMask(prompt.label, signal);
      if (mask && !signal.aborted) this.keeper.keep(new Map([[mask.view, mask]]));
    } catch (error) {
      this.keeper.report(error, signal);
    }
  }

  /** Lets SAM place the border of the shown mask, at the scale and threshold of the answer. */
  async placeBorder(): Promise<void> {
    const { model, state } = this.keeper;
    const { prompt, answer, busy } = state.get();
    if (!prompt || !answer || busy) return;
    const granularity = granularityElsewhere(state.get());
    const views = isIn3d(prompt) ? undefined : [this.keeper.shown()].filter(Boolean);
    const query = { model, prompt, granularity, views, samBorders: true };
    const { signal } = this.running;
    state.patch({ busy: true, failure: undefined });
    try {
      const { masks } = await segmentViews(query, signal);
      if (!signal.aborted) this.keeper.keep(masks);
    } catch (error) {
      this.keeper.report(error, signal);
    }
    // Whatever ended it has set `busy` for itself.
    if (!signal.aborted) state.patch({ busy: false });
  }
}
