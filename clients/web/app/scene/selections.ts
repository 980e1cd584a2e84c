// The selection of Gaussians in 3D: made, added to, subtracted from, hidden or shown alone.
import type { MessageInitShape } from '@bufbuild/protobuf';
import type {
  CreateSelectionRequestSchema,
  Selection,
} from '../../gen/pepeseg/v1/selection_service_pb';
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

function sourceOf(prompt: Prompt): MessageInitShape<typeof CreateSelectionRequestSchema>['source'] {
  const segment = prompt.kind === 'mask' ? prompt.segment : undefined;
  // The scales are left out: they are the default ones.
  if (segment) return { case: 'segment', value: { ...segment } };
  return { case: 'prompt', value: promptOf(prompt) };
}

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
      source: sourceOf(prompt),
      granularity: granularityOf(granularity),
      requestId: newRequestId(),
      ...(combined && { base, operation }),
    };
    await this.take(() => selections.createSelection(request));
  }

  /** Leaves what the prompt means out of the 3D view, too; what was hidden before stays hidden. */
  async hide(prompt: Prompt): Promise<void> {
    const isMore = this.state.get().showing === 'hidden';
    await this.select(prompt, {}, isMore ? operations.add : operations.select);
    if (!this.state.get().failure) this.show('hidden');
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
