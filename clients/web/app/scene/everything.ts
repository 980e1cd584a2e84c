// "Everything": all segments of the shown view at one level of the model's decomposition, to look at, pick
// and hide. The decomposition is made when it is first asked for, which may take a while.
import { segmentation, segmentsUrl } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { fetchFile } from '../api/fetch_file';
import { steadily } from '../api/server_link';
import type { GreyPicture } from '../mask/grey_png';
import { readGreyPng } from '../mask/grey_png';
import { Store } from '../store';
import type { Size } from './photo_frame';
import type { MaskPrompt } from './prompt';
import type { Decomposition, Level, SegmentId } from './segments';
import { decompositionOf, idAt, maskOfSegment, sameSegment } from './segments';
import type { SceneSelections } from './selections';

/** The ids of the segments of a view at a level. */
export interface SeenIds {
  readonly view: string;
  readonly level: Level;
  readonly picture: GreyPicture;
}

export interface EverythingState {
  readonly isOn: boolean;
  readonly level: Level;
  /** What is waited for. */
  readonly waits: 'nothing' | 'decomposition' | 'picture';
  /** Time at which the wait began, as of Date.now(). */
  readonly since: number;
  readonly failure: Failure | undefined;
  readonly decomposition: Decomposition | undefined;
  /** Ids in the shown view at the level; undefined until they come. */
  readonly seen: SeenIds | undefined;
  /** Segments that were hidden. */
  readonly hidden: readonly SegmentId[];
}

/** The longest that a decomposition may take, milliseconds. */
const longestMs = 1_800_000;
/** Pictures that are kept: those of some views at all levels. */
const maxKept = 24;
const nothingHidden: readonly SegmentId[] = [];

export class SceneEverything {
  readonly state = new Store<EverythingState>({
    isOn: false,
    level: 1,
    waits: 'nothing',
    since: 0,
    failure: undefined,
    decomposition: undefined,
    seen: undefined,
    hidden: nothingHidden,
  });
  /** Id of the segment under the pointer, or chosen in a list; 0: none. */
  readonly under = new Store(0);
  /** What the pointer does while everything is shown, in place of the preview of a click. */
  readonly pointer = {
    move: (_: string, { x, y }: { readonly x: number; readonly y: number }) => this.point(x, y),
    hold: () => undefined,
    leave: () => this.under.set(0),
  };
  private readonly kept = new Map<string, SeenIds>();
  private asking = new AbortController();
  private view = '';
  private size: Size = { width: 1, height: 1 };

  /** Segments that are not in the selections made by hiding them, by the selection's name. */
  private readonly hiddenIn = new Map<string, readonly SegmentId[]>();

  constructor(
    readonly model: string,
    private readonly selections: SceneSelections,
  ) {
    selections.state.follow(() => this.followSelection());
  }

  /** The shown view, and the size of its photograph. */
  show(view: string, size: Size): void {
    this.view = view;
    this.size = size;
    if (this.state.get().isOn) void this.look();
  }

  /** Shows everything, or ends it and what it waits for. */
  turn(isOn: boolean): void {
    this.asking.abort();
    this.under.set(0);
    this.state.patch({ isOn, waits: 'nothing', failure: undefined, seen: undefined });
    if (isOn) void this.look();
  }

  /** Called when the model is no longer shown. */
  end(): void {
    this.turn(false);
    this.kept.clear();
  }

  choose(level: Level): void {
    this.state.patch({ level });
    if (this.state.get().isOn) void this.look();
  }

  /** Returns the prompt of the segment at a position of the shown view; undefined: none is there. */
  promptAt(x: number, y: number): MaskPrompt | undefined {
    const { seen } = this.state.get();
    return seen && this.promptOf(idAt(seen.picture, this.size, x, y));
  }

  /** Returns the prompt of a segment of the shown view: its mask there. */
  promptOf(id: number): MaskPrompt | undefined {
    const { seen } = this.state.get();
    if (!seen || id === 0) return undefined;
    const { view, level, picture } = seen;
    const rle = maskOfSegment(picture, this.size, id);
    return { kind: 'mask', place: { view }, rle, isExact: true, segment: { level, id } };
  }

  numGaussians({ level, id }: SegmentId): number {
    return this.state.get().decomposition?.numGaussians[level]?.[id - 1] ?? 0;
  }

  isHidden(segment: SegmentId): boolean {
    return this.state.get().hidden.some((other) => sameSegment(other, segment));
  }

  /** Leaves a segment out of the 3D view. `prompt`: its prompt. Returns whether that worked. */
  async hide(prompt: MaskPrompt, segment: SegmentId): Promise<boolean> {
    const { hidden } = this.state.get();
    await this.selections.hide(prompt);
    const { selection, failure } = this.selections.state.get();
    if (!selection || failure) return false;
    this.hiddenIn.set(selection.name, [...hidden, segment]);
    this.followSelection();
    return true;
  }

  closeFailure(): void {
    this.turn(false);
  }

  /** What is hidden is what the shown selection says, whoever has chosen that. */
  private followSelection(): void {
    const { selection, showing } = this.selections.state.get();
    const named = showing === 'hidden' && selection ? this.hiddenIn.get(selection.name) : undefined;
    const hidden = named ?? nothingHidden;
    if (hidden !== this.state.get().hidden) this.state.patch({ hidden });
  }

  private point(x: number, y: number): void {
    const { seen } = this.state.get();
    this.under.set(seen ? idAt(seen.picture, this.size, x, y) : 0);
  }

  private async look(): Promise<void> {
    this.asking.abort();
    this.asking = new AbortController();
    const { signal } = this.asking;
    const { view } = this;
    const { level } = this.state.get();
    const known = this.kept.get(`${level} ${view}`);
    this.under.set(0);
    this.state.patch({ seen: known, waits: 'nothing', failure: undefined });
    if (known || !view) return;
    try {
      await this.decompose(signal);
      this.state.patch({ waits: 'picture', since: Date.now() });
      const picture = await this.picture(view, level, signal);
      if (signal.aborted) return;
      const seen = { view, level, picture };
      this.keep(seen);
      this.state.patch({ waits: 'nothing', seen });
    } catch (error) {
      if (signal.aborted || isCancelled(error)) return;
      this.state.patch({ waits: 'nothing', failure: failureOf(error) });
    }
  }

  private async decompose(signal: AbortSignal): Promise<void> {
    if (this.state.get().decomposition) return;
    this.state.patch({ waits: 'decomposition', since: Date.now() });
    const options = { signal, timeoutMs: longestMs };
    const ask = () => segmentation.decomposeModel({ model: this.model }, options);
    const decomposition = decompositionOf(await steadily(ask, signal));
    signal.throwIfAborted();
    this.state.patch({ decomposition });
  }

  private async picture(view: string, level: Level, signal: AbortSignal): Promise<GreyPicture> {
    const watch = { signal, progress: () => undefined };
    const file = await fetchFile(segmentsUrl(this.model, view, level), watch);
    return readGreyPng(new Uint8Array(await file.arrayBuffer()));
  }

  private keep(seen: SeenIds): void {
    this.kept.set(`${seen.level} ${seen.view}`, seen);
    const [oldest] = this.kept.keys();
    if (this.kept.size > maxKept && oldest !== undefined) this.kept.delete(oldest);
  }
}
