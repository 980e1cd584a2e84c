// Picks with names, which the server keeps as selections of the model.
import type { Selection } from '../../gen/pepeseg/v1/selection_service_pb';
import { allPages, newRequestId, selections } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { steadily } from '../api/server_link';
import type { History } from '../history';
import type { Subject } from '../scene/subject';
import { Store } from '../store';
import type { GaussianEdits } from './gaussian_edits';
import type { GaussianSet } from './gaussian_set';
import { bitsOf, setOfBits } from './gaussian_set';

export interface StoredPicksState {
  /** Selections of the model that have names, newest first. */
  readonly list: readonly Selection[];
  /** Their Gaussians by their names, of those that were needed so far. */
  readonly sets: ReadonlyMap<string, GaussianSet>;
  /** What is waited for; empty: nothing. */
  readonly waits: string;
  readonly failure: Failure | undefined;
}

/** Returns whether all Gaussians of a set are hidden. */
export function isHidden(set: GaussianSet | undefined, hidden: GaussianSet): boolean {
  if (!set || hidden.length !== set.length) return false;
  return set.every((isIn, i) => isIn === 0 || hidden[i] === 1);
}

export class StoredPicks {
  readonly state = new Store<StoredPicksState>({
    list: [],
    sets: new Map(),
    waits: '',
    failure: undefined,
  });

  constructor(
    private readonly subject: Pick<Subject, 'scene' | 'model'>,
    private readonly edits: GaussianEdits,
    private readonly history: History,
  ) {}

  async load(signal?: AbortSignal): Promise<void> {
    const { scene: parent, model: own } = this.subject;
    const all = await allPages(async (pageToken) => {
      const request = { parent, pageToken, pageSize: 1000 };
      const page = await selections.listSelections(request, signal ? { signal } : {});
      return { items: page.selections, nextPageToken: page.nextPageToken };
    });
    const list = all.filter(({ model, displayName }) => model === own && displayName !== '');
    this.state.patch({ list });
  }

  /** Stores what is picked under a name. Returns whether that worked. */
  store(displayName: string): Promise<boolean> {
    const { picked } = this.edits.state.get().edits;
    return this.run('Storing the picks', async () => {
      let made = await this.create(displayName, picked);
      this.history.add({
        name: `Name “${displayName}”`,
        undo: () => this.delete(made),
        redo: async () => {
          made = await this.create(displayName, picked);
        },
      });
    });
  }

  /** Picks the Gaussians of a stored selection. */
  choose(selection: Selection): Promise<boolean> {
    return this.run('Fetching the picks', async () => {
      const set = await this.setOf(selection);
      await this.edits.pick(async () => set, 'replace');
    });
  }

  /** Hides the Gaussians of a stored selection, or shows them. */
  toggle(selection: Selection): Promise<boolean> {
    return this.run('Fetching the picks', async () => {
      const set = await this.setOf(selection);
      const hides = !isHidden(set, this.edits.state.get().edits.hidden);
      const name = `${hides ? 'Hide' : 'Show'} “${selection.displayName}”`;
      this.edits.hide(name, set, hides);
    });
  }

  remove(selection: Selection): Promise<boolean> {
    return this.run('Deleting the picks', async () => {
      const set = await this.setOf(selection);
      let made = selection.name;
      await this.delete(made);
      this.history.add({
        name: `Deletion of “${selection.displayName}”`,
        undo: async () => {
          made = await this.create(selection.displayName, set);
        },
        redo: () => this.delete(made),
      });
    });
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined });
  }

  /** Returns the new selection's name. */
  private async create(displayName: string, set: GaussianSet): Promise<string> {
    const source = { case: 'gaussians', value: { bits: bitsOf(set) } } as const;
    const { model } = this.subject;
    const request = { model, source, displayName, requestId: newRequestId() };
    const { name } = await steadily(() => selections.createSelection(request));
    this.keep(name, set);
    await steadily(() => this.load());
    return name;
  }

  private async delete(name: string): Promise<void> {
    await steadily(() => selections.deleteSelection({ name }));
    await steadily(() => this.load());
  }

  private async setOf({ name }: Selection): Promise<GaussianSet> {
    await this.edits.load();
    const { gaussians, failure } = this.edits.state.get();
    if (!gaussians) throw new Error(failure?.what ?? 'the model’s Gaussians are not loaded');
    const known = this.state.get().sets.get(name);
    if (known) return known;
    const request = { name, wantGaussians: true };
    const { gaussians: found } = await steadily(() => selections.getSelection(request));
    const set = setOfBits(found?.bits ?? new Uint8Array(), gaussians.count);
    this.keep(name, set);
    return set;
  }

  private keep(name: string, set: GaussianSet): void {
    this.state.patch({ sets: new Map([...this.state.get().sets, [name, set]]) });
  }

  private async run(waits: string, act: () => Promise<void>): Promise<boolean> {
    this.state.patch({ waits, failure: undefined });
    try {
      await act();
      return true;
    } catch (error) {
      if (!isCancelled(error)) this.state.patch({ failure: failureOf(error) });
      return false;
    } finally {
      this.state.patch({ waits: '' });
    }
  }
}
