// What a person does to the Gaussians of a model in 3D: picks, hides, shows alone. The server's contract has
// no selections of Gaussians by their indices, so that all of this stays in the page.
import { plyUrl } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { fetchFile } from '../api/fetch_file';
import { Store } from '../store';
import type { GaussianPly } from './gaussian_ply';
import { plyOf, readGaussianPly } from './gaussian_ply';
import type { Combination, GaussianSet } from './gaussian_set';
import { combined, sizeOfSet } from './gaussian_set';

/** What can be undone. */
export interface Edits {
  readonly picked: GaussianSet;
  readonly hidden: GaussianSet;
  /** Whether only what is picked is shown. */
  readonly isAlone: boolean;
}

export interface GaussianState {
  /** Bytes of the model's file that came, while it is loaded. */
  readonly loading: { readonly done: number; readonly total: number } | undefined;
  readonly failure: Failure | undefined;
  /** Undefined: not loaded, so that nothing was changed. */
  readonly gaussians: GaussianPly | undefined;
  readonly edits: Edits;
  readonly numPicked: number;
  readonly numHidden: number;
}

const noGaussians: GaussianSet = new Uint8Array(0);
const nothingEdited: Edits = { picked: noGaussians, hidden: noGaussians, isAlone: false };

/** Returns the Gaussians that are not drawn. */
export function unseenOf({ picked, hidden, isAlone }: Edits): GaussianSet {
  return isAlone ? hidden.map((isHidden, i) => (isHidden || !picked[i] ? 1 : 0)) : hidden;
}

export class GaussianEdits {
  readonly state = new Store<GaussianState>({
    loading: undefined,
    failure: undefined,
    gaussians: undefined,
    edits: nothingEdited,
    numPicked: 0,
    numHidden: 0,
  });
  private file: Blob | undefined;
  private loaded: Promise<void> | undefined;
  private readonly controller = new AbortController();

  constructor(readonly model: string) {}

  /** Loads the model's Gaussians, once. Afterwards they are there, or the state has the failure. */
  load(): Promise<void> {
    return (this.loaded ??= this.fetchGaussians());
  }

  /** Picks Gaussians. `found` is called with the model's. */
  async pick(found: (gaussians: GaussianPly) => GaussianSet, how: Combination): Promise<void> {
    await this.load();
    const { gaussians, edits } = this.state.get();
    if (!gaussians) return;
    const picked = combined(edits.picked, found(gaussians), how);
    this.change({ picked, isAlone: edits.isAlone && sizeOfSet(picked) > 0 });
  }

  /** Leaves what is picked out of the view; it is no longer picked then. */
  hidePicked(): void {
    const { edits, numPicked } = this.state.get();
    if (numPicked === 0) return;
    const hidden = combined(edits.hidden, edits.picked, 'add');
    this.change({ hidden, picked: this.none(), isAlone: false });
  }

  /** Shows what was hidden. */
  showHidden(): void {
    this.change({ hidden: this.none() });
  }

  /** Shows only what is picked, or all again. */
  showAlone(isAlone: boolean): void {
    this.change({ isAlone });
  }

  clear(): void {
    this.change({ picked: this.none(), isAlone: false });
  }

  closeFailure(): void {
    this.loaded = undefined;
    this.state.patch({ failure: undefined });
  }

  /** Returns a PLY of these Gaussians, whose records are the model's, byte for byte. */
  async plyOf(set: GaussianSet): Promise<Blob> {
    if (!this.file) throw new Error('the model’s Gaussians are not loaded');
    return plyOf(this.file, set);
  }

  end(): void {
    this.controller.abort();
  }

  private none(): GaussianSet {
    return new Uint8Array(this.state.get().gaussians?.count ?? 0);
  }

  private change(change: Partial<Edits>): void {
    this.put({ ...this.state.get().edits, ...change });
  }

  private put(edits: Edits): void {
    const { picked, hidden } = edits;
    this.state.patch({ edits, numPicked: sizeOfSet(picked), numHidden: sizeOfSet(hidden) });
  }

  private async fetchGaussians(): Promise<void> {
    const { signal } = this.controller;
    const progress = (done: number, total: number) => this.state.patch({ loading: { done, total } });
    try {
      this.file = await fetchFile(plyUrl(this.model), { signal, progress });
      const gaussians = readGaussianPly(await this.file.arrayBuffer());
      this.state.patch({ gaussians });
      this.put({ ...nothingEdited, picked: this.none(), hidden: this.none() });
    } catch (error) {
      if (!signal.aborted && !isCancelled(error)) this.state.patch({ failure: failureOf(error) });
    } finally {
      this.state.patch({ loading: undefined });
    }
  }
}
