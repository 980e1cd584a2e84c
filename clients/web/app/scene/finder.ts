// Finds things by a word, or all that look like one, and their masks in the shown view.
import { segmentation } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { steadily } from '../api/server_link';
import { Store } from '../store';
import { acceptedFor } from './accepted_mask';
import type { Mask } from './answer';
import type { FoundThings } from './found_things';
import { foundIn } from './found_things';
import type { Granularity, Prompt } from './prompt';
import { granularityOf, promptOf } from './prompt';
import { segmentViews } from './segment_views';

export interface FinderState {
  /** The word that was asked for; empty: things that look alike. */
  readonly word: string;
  readonly busy: boolean;
  readonly failure: Failure | undefined;
  readonly found: FoundThings | undefined;
  /** Masks in the shown view, by the index of the thing. */
  readonly masks: ReadonlyMap<number, Mask>;
}

const nothingAsked: FinderState = {
  word: '',
  busy: false,
  failure: undefined,
  found: undefined,
  masks: new Map(),
};

export class SceneFinder {
  readonly state = new Store<FinderState>(nothingAsked);
  private asking = new AbortController();
  private looking = new AbortController();
  private shownView = '';

  constructor(readonly model: string) {}

  async findWord(word: string): Promise<void> {
    await this.find({ case: 'text', value: word }, {}, word);
  }

  /** Finds all things that look like what the prompt means. */
  async findLike(prompt: Prompt, granularity: Granularity): Promise<void> {
    await this.find({ case: 'like', value: promptOf(prompt) }, granularity, '');
  }

  /** The shown view, in which the masks of what was found are drawn. */
  show(view: string): void {
    if (view === this.shownView) return;
    this.shownView = view;
    void this.look();
  }

  clear(): void {
    this.asking.abort();
    this.looking.abort();
    this.state.set(nothingAsked);
  }

  private async find(
    what:
      | { case: 'text'; value: string }
      | { case: 'like'; value: ReturnType<typeof promptOf> },
    granularity: Granularity,
    word: string,
  ): Promise<void> {
    this.clear();
    this.asking = new AbortController();
    const { signal } = this.asking;
    this.state.patch({ busy: true, word });
    const request = { model: this.model, what, granularity: granularityOf(granularity) };
    try {
      const response = await steadily(
        () => segmentation.findSegments(request, { signal }),
        signal,
      );
      if (signal.aborted) return;
      this.state.patch({ busy: false, found: foundIn(response) });
      await this.look();
    } catch (error) {
      if (signal.aborted || isCancelled(error)) return;
      this.state.patch({ busy: false, failure: failureOf(error) });
    }
  }

  /** Asks for the masks in the shown view, one thing after the other, the best first. */
  private async look(): Promise<void> {
    this.looking.abort();
    this.looking = new AbortController();
    const { signal } = this.looking;
    this.state.patch({ masks: new Map() });
    const { model, shownView: view } = this;
    const things = this.state.get().found?.things ?? [];
    if (!view) return;
    for (const [index, { prompt, granularity }] of things.entries()) {
      try {
        const query = { model, prompt, granularity, views: [view] };
        const accepted = await acceptedFor(prompt, signal);
        const isAccepted = accepted?.view === view;
        const mask = isAccepted ? accepted : (await segmentViews(query, signal)).masks.get(view);
        if (signal.aborted) return;
        if (mask) this.state.patch({ masks: new Map([...this.state.get().masks, [index, mask]]) });
      } catch (error) {
        if (signal.aborted || isCancelled(error)) return;
        // The others may be answered.
        this.state.patch({ failure: failureOf(error) });
      }
    }
  }
}
