// The selection of Gaussians in 3D: made, added to, subtracted from, hidden or shown alone.
import type { Selection } from '../../gen/pepeseg/v1/selection_service_pb';
import { SetOperation } from '../../gen/pepeseg/v1/selection_service_pb';
import { newRequestId, selections } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import { Store } from '../store';
import type { Granularity, Prompt } from './prompt';
import { granularityOf, promptOf } from './prompt';

/** How the selection and the rest are drawn in 3D. */
export type Showing = 'all' | 'tinted' | 'isolated' | 'hidden';

export interface SelectionState {
  readonly selection: Selection | undefined;
  readonly showing: Showing;
  readonly busy: boolean;
  readonly failure: Failure | undefined;
}

export const operations = {
  select: SetOperation.REPLACE,
  add: SetOperation.UNION,
  subtract: SetOperation.SUBTRACT,
  intersect: SetOperation.INTERSECT,
} as const;

export class SceneSelections {
  readonly state = new Store<SelectionState>({
    selection: undefined,
    showing: 'all',
    busy: false,
    failure: undefined,
  });

  constructor(readonly model: string) {}

  async select(prompt: Prompt, granularity: Granularity, operation: SetOperation): Promise<void> {
    const base = this.state.get().selection?.name;
    const combined = operation !== SetOperation.REPLACE && base !== undefined;
    const request = {
      model: this.model,
      source: { case: 'prompt', value: promptOf(prompt) } as const,
      granularity: granularityOf(granularity),
      requestId: newRequestId(),
      ...(combined && { base, operation }),
    };
    await this.take(() => selections.createSelection(request));
  }

  async undo(): Promise<void> {
    const { selection } = this.state.get();
    if (!selection) return;
    if (selection.base) await this.take(() => selections.undoSelection({ name: selection.name }));
    else this.clear();
  }

  clear(): void {
    this.state.patch({ selection: undefined, showing: 'all', failure: undefined });
  }

  show(showing: Showing): void {
    if (this.state.get().selection) this.state.patch({ showing });
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined });
  }

  private async take(ask: () => Promise<Selection>): Promise<void> {
    this.state.patch({ busy: true, failure: undefined });
    try {
      const selection = await steadily(ask);
      const { showing } = this.state.get();
      this.state.patch({ selection, showing: showing === 'all' ? 'tinted' : showing });
    } catch (error) {
      this.state.patch({ failure: failureOf(error) });
    } finally {
      this.state.patch({ busy: false });
    }
  }
}
