// Work that takes long, such as an export or an edit: what it does now, how far it is, and its end.
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { Store } from '../store';

/** What a step counts. */
export type TaskUnit = 'masks' | 'bytes' | 'steps';

/** A step of the work. */
export interface TaskStep {
  readonly name: string;
  readonly unit: TaskUnit;
  readonly done: number;
  /** 0: not known yet. */
  readonly total: number;
}

export interface TaskState {
  /** Undefined: nothing runs. */
  readonly step: TaskStep | undefined;
  readonly failure: Failure | undefined;
}

/** Follows a step, and ends it. */
export interface Watch {
  /** Throws if the work was cancelled. `total` 0: not known yet. */
  readonly progress: (done: number, total: number) => void;
  readonly signal: AbortSignal;
}

/** Returns the watch of a step of this name. */
export type Steps = (name: string, unit: TaskUnit) => Watch;

export class RunningTask {
  readonly state = new Store<TaskState>({ step: undefined, failure: undefined });
  private running: AbortController | undefined;

  /** Runs work; one at a time. */
  async run(work: (steps: Steps) => Promise<void>): Promise<void> {
    if (this.running) return;
    const controller = new AbortController();
    const { signal } = controller;
    this.running = controller;
    this.state.set({ step: undefined, failure: undefined });
    try {
      await work((name, unit) => ({
        signal,
        progress: (done, total) => {
          signal.throwIfAborted();
          this.state.patch({ step: { name, unit, done, total } });
        },
      }));
    } catch (error) {
      const ended = signal.aborted || isCancelled(error);
      if (!ended) this.state.patch({ failure: failureOf(error) });
    } finally {
      if (this.running === controller) this.running = undefined;
      if (!signal.aborted) this.state.patch({ step: undefined });
    }
  }

  cancel(): void {
    this.running?.abort();
    this.running = undefined;
    this.state.patch({ step: undefined });
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined });
  }
}
