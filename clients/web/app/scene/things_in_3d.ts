// The named things in their colours in 3D: a selection of Gaussians for each, without those of the things
// before it, so that each Gaussian is drawn once.
import type { Selection } from '../../gen/pepeseg/v1/selection_service_pb';
import { SetOperation } from '../../gen/pepeseg/v1/selection_service_pb';
import { newRequestId, selections } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { steadily } from '../api/server_link';
import { Store } from '../store';
import type { SceneLabels } from './labels';

/** The Gaussians of a thing. */
export interface ThingPart {
  /** Name of the label. */
  readonly label: string;
  /** Name of the selection. */
  readonly selection: string;
}

export interface ColouredThings {
  readonly parts: readonly ThingPart[];
  /** Name of the selection of all of them. */
  readonly all: string;
}

export interface ThingsIn3dState {
  readonly isOn: boolean;
  /** Number of things that are selected, while others are still to come. */
  readonly done: number;
  readonly busy: boolean;
  readonly failure: Failure | undefined;
  /** Undefined: nothing is coloured. */
  readonly things: ColouredThings | undefined;
}

/** Selections while they are made. */
interface Run {
  readonly controller: AbortController;
  /** Names of those that were made, to be deleted. */
  readonly made: string[];
}

const nothingSelected = { done: 0, busy: false, failure: undefined, things: undefined } as const;

export class ThingsIn3d {
  readonly state = new Store<ThingsIn3dState>({ isOn: false, ...nothingSelected });
  private run: Run = { controller: new AbortController(), made: [] };

  constructor(
    readonly model: string,
    private readonly labels: SceneLabels,
  ) {
    labels.list.follow(() => {
      if (this.state.get().isOn) this.turn(true);
    });
  }

  /** Colours the things that have names now, or ends that. */
  turn(isOn: boolean): void {
    this.run.controller.abort();
    forget(this.run);
    this.run = { controller: new AbortController(), made: [] };
    this.state.set({ isOn, ...nothingSelected });
    if (isOn) void this.select(this.run);
  }

  private async select(run: Run): Promise<void> {
    const names = this.labels.list.get().map(({ name }) => name);
    const parts: ThingPart[] = [];
    let all: string | undefined;
    this.state.patch({ busy: names.length > 0 });
    try {
      for (const label of names) {
        const whole = await this.create(label, run);
        const own = all ? await this.combine(whole.name, all, SetOperation.SUBTRACT, run) : whole;
        const sum = all ? await this.combine(all, whole.name, SetOperation.UNION, run) : whole;
        all = sum.name;
        // A file without Gaussians cannot be shown.
        if (own.numGaussians > 0n) parts.push({ label, selection: own.name });
        this.state.patch({ done: this.state.get().done + 1 });
      }
      this.state.patch({ busy: false, things: all && parts.length > 0 ? { parts, all } : undefined });
    } catch (error) {
      if (run.controller.signal.aborted || isCancelled(error)) return;
      this.state.patch({ busy: false, failure: failureOf(error) });
    }
  }

  private create(label: string, run: Run): Promise<Selection> {
    const source = { case: 'prompt', value: { what: { case: 'label', value: label } } } as const;
    const request = { model: this.model, source, requestId: newRequestId() };
    const { signal } = run.controller;
    return kept(run, () => selections.createSelection(request, { signal }));
  }

  private combine(
    first: string,
    second: string,
    operation: SetOperation,
    run: Run,
  ): Promise<Selection> {
    const request = { first, second, operation, requestId: newRequestId() };
    const { signal } = run.controller;
    return kept(run, () => selections.combineSelections(request, { signal }));
  }
}

/** Returns the selection that is made, which is deleted with the others of the run. */
async function kept(run: Run, ask: () => Promise<Selection>): Promise<Selection> {
  const { signal } = run.controller;
  const selection = await steadily(ask, signal);
  run.made.push(selection.name);
  if (signal.aborted) forget(run);
  signal.throwIfAborted();
  return selection;
}

/** Deletes the selections of a run, which are of no further use. */
function forget({ made }: Run): void {
  for (const name of made.splice(0)) {
    selections.deleteSelection({ name }).catch(() => undefined);
  }
}
