// The masks of the named things in the shown view, all at once, and which of them are shown.
import { isCancelled } from '../api/failure';
import { Store } from '../store';
import { acceptedFor } from './accepted_mask';
import type { Mask } from './answer';
import type { SceneLabels } from './labels';
import type { Prompt } from './prompt';
import { segmentViews } from './segment_views';

export interface ThingMasksState {
  /** Whether things are shown at all. */
  readonly isOn: boolean;
  /** Names of labels that are not shown. */
  readonly hidden: ReadonlySet<string>;
  /** Masks in the shown view by the label's name, of those that were segmented so far. */
  readonly masks: ReadonlyMap<string, Mask>;
  /** Whether masks are still to come. */
  readonly busy: boolean;
}

export class ThingMasks {
  readonly state = new Store<ThingMasksState>({
    isOn: true,
    hidden: new Set(),
    masks: new Map(),
    busy: false,
  });
  /** Masks by view, then by label. */
  private readonly known = new Map<string, Map<string, Mask>>();
  private looking = new AbortController();
  private view = '';

  constructor(
    readonly model: string,
    private readonly labels: SceneLabels,
  ) {
    labels.list.follow(() => this.followLabels());
  }

  /** The shown view. */
  show(view: string): void {
    if (view === this.view) return;
    this.view = view;
    this.put();
    void this.look();
  }

  turn(isOn: boolean): void {
    this.state.patch({ isOn });
    void this.look();
  }

  /** Shows or hides one thing. */
  toggle(label: string): void {
    const hidden = new Set(this.state.get().hidden);
    if (!hidden.delete(label)) hidden.add(label);
    this.state.patch({ hidden });
    void this.look();
  }

  /** Called when the model is no longer shown. */
  end(): void {
    this.view = '';
    this.looking.abort();
  }

  /** A label of a deleted one's name is another thing. */
  private followLabels(): void {
    const names = new Set(this.labels.list.get().map(({ name }) => name));
    for (const masks of this.known.values()) {
      for (const label of masks.keys()) {
        if (!names.has(label)) masks.delete(label);
      }
    }
    this.put();
    void this.look();
  }

  private put(): void {
    this.state.patch({ masks: new Map(this.known.get(this.view)) });
  }

  /** Segments the shown things whose masks are not there, one after the other. */
  private async look(): Promise<void> {
    this.looking.abort();
    this.looking = new AbortController();
    const { signal } = this.looking;
    const { view } = this;
    const { isOn, hidden } = this.state.get();
    const masks = this.known.get(view) ?? new Map<string, Mask>();
    this.known.set(view, masks);
    const missing = this.labels.list
      .get()
      .filter(({ name }) => isOn && view && !masks.has(name) && !hidden.has(name));
    this.state.patch({ busy: missing.length > 0 });
    for (const { name } of missing) {
      try {
        const mask = await this.maskIn(view, { kind: 'label', label: name }, signal);
        if (signal.aborted) return;
        if (mask) masks.set(name, mask);
        this.put();
      } catch (error) {
        if (signal.aborted || isCancelled(error)) return;
        // It is not drawn. A click on the thing reports what is wrong with it.
      }
    }
    if (!signal.aborted) this.state.patch({ busy: false });
  }

  private async maskIn(
    view: string,
    prompt: Prompt,
    signal: AbortSignal,
  ): Promise<Mask | undefined> {
    const accepted = await acceptedFor(prompt, signal);
    if (accepted?.view === view) return accepted;
    const query = { model: this.model, prompt, granularity: {}, views: [view] };
    return (await segmentViews(query, signal)).masks.get(view);
  }
}
