// What a person picks, hides, shows alone and cuts off of a model's Gaussians in 3D. The model stays as it is.
import { plyUrl } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { fetchFile } from '../api/fetch_file';
import { History, changeOf } from '../history';
import { Store } from '../store';
import type { CropBox } from './crop_box';
import { boxAround, withOutside } from './crop_box';
import type { SightOfPhotograph } from './floaters';
import type { GaussianPly } from './gaussian_ply';
import { plyOf } from './gaussian_ply';
import type { Combination, GaussianSet } from './gaussian_set';
import { combined, complementOf, setOfBits, sizeOfSet } from './gaussian_set';
import type { GaussianWork } from './gaussian_work';
import { WorkInWorker } from './gaussian_work';

/** What can be undone. */
export interface Edits {
  readonly picked: GaussianSet;
  readonly hidden: GaussianSet;
  /** Whether only what is picked is shown. */
  readonly isAlone: boolean;
  /** Undefined: nothing is cut off. */
  readonly crop: CropBox | undefined;
}

export interface GaussianState {
  /** Bytes of the model's file that came, while it is loaded. */
  readonly loading: { readonly done: number; readonly total: number } | undefined;
  /** Whether floaters are looked for. */
  readonly searching: boolean;
  /** Number of floaters that were found last; undefined once something else was picked. */
  readonly numFloaters: number | undefined;
  readonly failure: Failure | undefined;
  /** Undefined: not loaded, so that nothing was changed. */
  readonly gaussians: GaussianPly | undefined;
  readonly edits: Edits;
  readonly numPicked: number;
  readonly numHidden: number;
}

/** Returns those of the model's Gaussians that are meant. */
export type FindGaussians = (gaussians: GaussianPly) => Promise<GaussianSet>;

const noGaussians: GaussianSet = new Uint8Array(0);
const nothingEdited: Edits = {
  picked: noGaussians,
  hidden: noGaussians,
  isAlone: false,
  crop: undefined,
};

/** Returns the Gaussians that are hidden or outside the crop box. */
export function removedOf({ hidden, crop }: Edits, { centers }: GaussianPly): GaussianSet {
  return crop ? withOutside(hidden, crop, centers) : hidden;
}

/** Returns the Gaussians that are not drawn. */
export function unseenOf(edits: Edits, gaussians: GaussianPly): GaussianSet {
  const removed = removedOf(edits, gaussians);
  const { isAlone, picked } = edits;
  return isAlone ? removed.map((isIn, i) => (isIn || !picked[i] ? 1 : 0)) : removed;
}

export class GaussianEdits {
  readonly state = new Store<GaussianState>({
    loading: undefined,
    searching: false,
    numFloaters: undefined,
    failure: undefined,
    gaussians: undefined,
    edits: nothingEdited,
    numPicked: 0,
    numHidden: 0,
  });
  private file: Blob | undefined;
  private loaded: Promise<void> | undefined;
  /** Resolved when the picks so far are done. */
  private picks: Promise<void> = Promise.resolve();
  /** What was before the faces of the crop box began to move. */
  private beforeMove: Edits | undefined;
  private controller = new AbortController();

  /** `first`: what is picked at first, as in GaussianBits. */
  constructor(
    readonly model: string,
    private readonly history = new History(),
    private first?: Uint8Array,
    private readonly work: GaussianWork = new WorkInWorker(),
  ) {}

  /** Called when the model is shown: what was picked or hidden before is drawn again. */
  begin(): void {
    if (this.first || this.state.get().edits.picked.length > 0) void this.load();
  }

  /** Loads the model's Gaussians, once. Afterwards they are there, or the state has the failure. */
  load(): Promise<void> {
    return (this.loaded ??= this.fetchGaussians());
  }

  /**
   * Picks Gaussians, after the picks before are done. `found` is called with the model's. Rejects with the
   * error of `found`.
   */
  pick(found: FindGaussians, how: Combination): Promise<void> {
    const picked = this.picks.then(() => this.pickNow(found, how));
    this.picks = picked.catch(() => undefined);
    return picked;
  }

  /** Picks what bits as in GaussianBits say. */
  pickBits(bits: Uint8Array): Promise<void> {
    return this.pick(async ({ count }) => setOfBits(bits, count), 'replace');
  }

  /** Hides the picked Gaussians, which are then no longer picked. */
  hidePicked(): void {
    const { edits, numPicked } = this.state.get();
    if (numPicked === 0) return;
    const hidden = combined(edits.hidden, edits.picked, 'add');
    this.change('Hide', { hidden, picked: this.none(), isAlone: false });
  }

  /** Hides Gaussians, or shows them. `name`: what the change is called. */
  hide(name: string, set: GaussianSet, isHidden: boolean): void {
    const { hidden } = this.state.get().edits;
    this.change(name, { hidden: combined(hidden, set, isHidden ? 'add' : 'subtract') });
  }

  /** Shows what was hidden. */
  showHidden(): void {
    this.change('Show hidden', { hidden: this.none() });
  }

  /** Shows only what is picked, or all again. */
  showAlone(isAlone: boolean): void {
    this.change('Only picked', { isAlone });
  }

  clear(): void {
    this.change('Pick nothing', { picked: this.none(), isAlone: false });
  }

  /** Shows the crop box, at first around the middle 90 % of the Gaussians, or ends it. */
  async turnCrop(isOn: boolean): Promise<void> {
    await this.load();
    const { gaussians } = this.state.get();
    if (!gaussians) return;
    this.change('Crop box', { crop: isOn ? boxAround(gaussians.centers) : undefined });
  }

  /** Moves the faces of the crop box, until restCrop(). */
  cropTo(crop: CropBox): void {
    const { edits } = this.state.get();
    this.beforeMove ??= edits;
    this.put({ ...edits, crop });
  }

  /** The faces rest: their move is one change. */
  restCrop(): void {
    const before = this.beforeMove;
    this.beforeMove = undefined;
    if (before) this.remember('Crop', before);
  }

  /** Picks the floaters of what is drawn (floaters.ts). */
  async pickFloaters(photographs: readonly SightOfPhotograph[]): Promise<void> {
    this.state.patch({ searching: true });
    try {
      await this.load();
      const { gaussians } = this.state.get();
      if (!gaussians) return;
      const found = await this.work.floaters(gaussians, photographs);
      const removed = removedOf(this.state.get().edits, gaussians);
      const picked = found.map((isIn, i) => (removed[i] ? 0 : isIn));
      this.change('Floaters', { picked, isAlone: false });
      this.state.patch({ numFloaters: this.state.get().numPicked });
    } catch (error) {
      this.state.patch({ failure: failureOf(error) });
    } finally {
      this.state.patch({ searching: false });
    }
  }

  closeFailure(): void {
    this.loaded = undefined;
    this.state.patch({ failure: undefined });
  }

  /** Returns the Gaussians that are neither hidden nor outside the crop box. */
  kept(): GaussianSet {
    const { edits, gaussians } = this.state.get();
    return gaussians ? complementOf(removedOf(edits, gaussians)) : noGaussians;
  }

  /** Returns a PLY of these Gaussians, whose records are the model's, byte for byte. */
  async plyOf(set: GaussianSet): Promise<Blob> {
    if (!this.file) throw new Error('the model’s Gaussians are not loaded');
    return plyOf(this.file, set);
  }

  /** Called when the model is no longer shown: its Gaussians are forgotten, what was done to them is not. */
  end(): void {
    this.controller.abort();
    this.controller = new AbortController();
    this.work.end();
    this.file = undefined;
    this.loaded = undefined;
    this.picks = Promise.resolve();
    this.state.patch({ gaussians: undefined, loading: undefined, searching: false });
  }

  private async pickNow(found: FindGaussians, how: Combination): Promise<void> {
    await this.load();
    const { gaussians } = this.state.get();
    if (!gaussians) return;
    const set = await found(gaussians);
    const { edits } = this.state.get();
    const picked = combined(edits.picked, set, how);
    this.change('Pick', { picked, isAlone: edits.isAlone && sizeOfSet(picked) > 0 });
  }

  private none(): GaussianSet {
    return new Uint8Array(this.state.get().edits.picked.length);
  }

  private change(name: string, change: Partial<Edits>): void {
    const before = this.state.get().edits;
    this.put({ ...before, ...change });
    this.remember(name, before);
  }

  private remember(name: string, before: Edits): void {
    this.history.add(changeOf(name, before, this.state.get().edits, (edits) => this.put(edits)));
  }

  private put(edits: Edits): void {
    const { picked, hidden } = edits;
    const before = this.state.get();
    const isPicked = picked !== before.edits.picked;
    this.state.patch({
      edits,
      numPicked: isPicked ? sizeOfSet(picked) : before.numPicked,
      numHidden: hidden !== before.edits.hidden ? sizeOfSet(hidden) : before.numHidden,
      numFloaters: isPicked ? undefined : before.numFloaters,
    });
  }

  private async fetchGaussians(): Promise<void> {
    const { signal } = this.controller;
    const progress = (done: number, total: number) => this.state.patch({ loading: { done, total } });
    try {
      const file = await fetchFile(plyUrl(this.model), { signal, progress });
      const gaussians = await this.work.read(file);
      signal.throwIfAborted();
      this.file = file;
      this.state.patch({ gaussians });
      this.putFirst(gaussians.count);
    } catch (error) {
      if (!signal.aborted && !isCancelled(error)) this.state.patch({ failure: failureOf(error) });
    } finally {
      if (!signal.aborted) this.state.patch({ loading: undefined });
    }
  }

  /** Puts what is picked at first, unless something was done before. */
  private putFirst(count: number): void {
    if (this.state.get().edits.picked.length === count) return;
    const picked = this.first ? setOfBits(this.first, count) : new Uint8Array(count);
    this.first = undefined;
    this.put({ ...nothingEdited, picked, hidden: new Uint8Array(count) });
  }
}
