// Requests that are made when clicks and sliders rest: for the sizes that the prompt may mean, and for
// the masks of the views that are not answered yet.
import type { Store } from '../store';
import type { Answer, Proposal } from './answer';
import type { Prompt } from './prompt';
import { ownViewOf } from './prompt';
import { proposeSizes } from './propose_sizes';
import { batchesOf, samBatches, segmentViews } from './segment_views';
import type { Found, SessionState } from './session_state';
import { granularityElsewhere, isForSam } from './session_state';

/** Milliseconds without another request after which all views are requested. */
const settleMs = 180;

/** The session whose prompt is answered. */
export interface Asker {
  readonly model: string;
  readonly views: readonly string[];
  readonly state: Store<SessionState>;
  shown(): string;
  soFar(): Found;
  takeProposals(proposals: readonly Proposal[] | undefined): void;
  /** `bySam`: SAM was asked, too. */
  takeMasks(masks: Answer['masks'], bySam: boolean): void;
  /** Called with what ended a request, and its signal. */
  report(error: unknown, signal: AbortSignal): void;
}

export class OtherViews {
  private settling: ReturnType<typeof setTimeout> | undefined;
  private running = new AbortController();

  constructor(private readonly asker: Asker) {}

  /** Asks as soon as there has been no other request for a while. */
  ask(): void {
    this.stop();
    this.asker.state.patch({ looking: true });
    this.settling = setTimeout(() => void this.settle(), settleMs);
  }

  stop(): void {
    clearTimeout(this.settling);
    this.running.abort();
  }

  private async settle(): Promise<void> {
    const { state } = this.asker;
    const { prompt, answer, busy } = state.get();
    if (busy) return this.ask();
    if (!prompt || !answer) return state.patch({ looking: false });
    this.running = new AbortController();
    const { signal } = this.running;
    await Promise.all([this.propose(prompt, signal), this.look(prompt, signal)]);
  }

  private async propose(prompt: Prompt, signal: AbortSignal): Promise<void> {
    const { asker } = this;
    if (asker.soFar().proposals) return;
    try {
      const proposals = await proposeSizes(asker.model, prompt, signal);
      if (!signal.aborted) asker.takeProposals(proposals);
    } catch (error) {
      asker.report(error, signal);
    }
  }

  /** Segments the views whose masks are not current, from the shown one on. */
  private async look(prompt: Prompt, signal: AbortSignal): Promise<void> {
    const { asker } = this;
    const { model, views, state } = asker;
    const bySam = isForSam(state.get());
    const samClicks = bySam ? state.get().samClicks : 'off';
    const samBorders = state.get().samClicks === 'off' ? false : undefined;
    const granularity = granularityElsewhere(state.get());
    const shown = asker.shown();
    const from = Math.max(0, views.indexOf(shown));
    const inOrder = [...views.slice(from), ...views.slice(0, from)];
    const { current } = state.get();
    const batches = bySam
      ? samBatches(ownViewOf(prompt), shown, inOrder, asker.soFar().kept)
      : batchesOf(inOrder.filter((view) => !current.has(view)));
    try {
      for (const batch of batches) {
        const query = { model, prompt, granularity, views: batch, samClicks, samBorders };
        const { masks } = await segmentViews(query, signal);
        if (signal.aborted) return;
        asker.takeMasks(masks, bySam);
      }
    } catch (error) {
      asker.report(error, signal);
    }
    if (!signal.aborted) state.patch({ looking: false });
  }
}
