// A history of a person's changes, which can be undone and done again: one for all that changes a scene.
import type { Failure } from './api/failure';
import { failureOf } from './api/failure';
import { Store } from './store';

export interface Change {
  /** A noun, as "Click". */
  readonly name: string;
  undo(): void | Promise<void>;
  redo(): void | Promise<void>;
}

export interface HistoryState {
  /** Names of the changes that undo and redo are about; undefined: there is none. */
  readonly undo: string | undefined;
  readonly redo: string | undefined;
  /** Whether the server undoes or redoes a change. */
  readonly busy: boolean;
  readonly failure: Failure | undefined;
}

/** Maximum number of changes that are kept; the oldest are forgotten. */
const maxChanges = 50;

export class History {
  readonly state = new Store<HistoryState>({
    undo: undefined,
    redo: undefined,
    busy: false,
    failure: undefined,
  });
  private done: Change[] = [];
  private undone: Change[] = [];

  /** Adds what was done, and returns it. What was undone before cannot be done again. */
  add(change: Change): Change {
    this.done = [...this.done, change].slice(-maxChanges);
    this.undone = [];
    this.report();
    return change;
  }

  /** Forgets a change that did nothing. */
  drop(change: Change): void {
    this.done = this.done.filter((other) => other !== change);
    this.report();
  }

  /** Makes two changes one, which is where the first was; without the first, the second is added. */
  join(first: Change | undefined, second: Change): void {
    if (!first || !this.done.includes(first)) {
      this.add(second);
      return;
    }
    const both: Change = {
      name: second.name,
      undo: async () => {
        await second.undo();
        await first.undo();
      },
      redo: async () => {
        await first.redo();
        await second.redo();
      },
    };
    this.done = this.done.map((other) => (other === first ? both : other));
    this.report();
  }

  /** Forgets all changes. */
  clear(): void {
    this.done = [];
    this.undone = [];
    this.report();
  }

  isNewest(change: Change | undefined): boolean {
    return change !== undefined && this.done.at(-1) === change;
  }

  /** Undoes the newest change. If that fails, the state has the failure, and the change stays. */
  async undo(): Promise<void> {
    const change = this.done.at(-1);
    if (!change || !(await this.run(() => change.undo()))) return;
    this.done = this.done.filter((other) => other !== change);
    this.undone = [...this.undone, change];
    this.report();
  }

  /** Does again what was undone last. */
  async redo(): Promise<void> {
    const change = this.undone.at(-1);
    if (!change || !(await this.run(() => change.redo()))) return;
    this.undone = this.undone.filter((other) => other !== change);
    this.done = [...this.done, change];
    this.report();
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined });
  }

  /** Returns whether it worked. */
  private async run(act: () => void | Promise<void>): Promise<boolean> {
    if (this.state.get().busy) return false;
    this.state.patch({ busy: true, failure: undefined });
    try {
      const wait = act();
      if (wait) await wait;
      return true;
    } catch (error) {
      this.state.patch({ failure: failureOf(error) });
      return false;
    } finally {
      this.state.patch({ busy: false });
    }
  }

  private report(): void {
    this.state.patch({ undo: this.done.at(-1)?.name, redo: this.undone.at(-1)?.name });
  }
}

/** Returns the change from one value of a state to another. */
export function changeOf<T>(name: string, before: T, after: T, put: (value: T) => void): Change {
  return { name, undo: () => put(before), redo: () => put(after) };
}
