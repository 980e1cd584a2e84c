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
import { History, changeOf } from '../history';
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

type Shown = Pick<SelectionState, 'selection' | 'showing'>;

export const operations = {
  select: SetOperation.REPLACE,
  add: SetOperation.UNION,
  subtract: SetOperation.SUBTRACT,
  intersect: SetOperation.INTERSECT,
} as const;

/** Returns what a selection of the prompt is made from. */
export function sourceOf(prompt: Prompt): MessageInitShape<typeof CreateSelectionRequestSchema>['source'] {
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

  constructor(
    readonly model: string,
    private readonly history = new History(),
  ) {}

  /** Selects what the prompt means, and shows the selection: at first tinted, else as the one before. */
  async select(
    prompt: Prompt,
    granularity: Granularity,
    operation: SetOperation,
    showing?: Showing,
  ): Promise<void> {
    const base = this.state.get().selection?.name;
    const combined = operation !== SetOperation.REPLACE && base !== undefined;
    const request = {
      model: this.model,
      source: sourceOf(prompt),
      granularity: granularityOf(granularity),
      requestId: newRequestId(),
      ...(combined && { base, operation }),
    };
    await this.take(() => selections.createSelection(request), showing);
  }

  /** Leaves what the prompt means out of the 3D view, too; what was hidden before stays hidden. */
  async hide(prompt: Prompt): Promise<void> {
    const isMore = this.state.get().showing === 'hidden';
    await this.select(prompt, {}, isMore ? operations.add : operations.select, 'hidden');
  }

  show(showing: Showing): void {
    const { selection, showing: before } = this.state.get();
    if (selection && showing !== before) this.put('Display in 3D', { selection, showing });
  }

  clear(): void {
    if (this.state.get().selection) this.put('Show all', { selection: undefined, showing: 'all' });
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined });
  }

  private put(name: string, shown: Shown): void {
    const { selection, showing } = this.state.get();
    this.state.patch(shown);
    const put = (value: Shown) => this.state.patch({ ...value, failure: undefined });
    this.history.add(changeOf(name, { selection, showing }, shown, put));
  }

  private async take(ask: () => Promise<Selection>, how?: Showing): Promise<void> {
    this.state.patch({ busy: true, failure: undefined });
    try {
      const selection = await steadily(ask);
      const { showing } = this.state.get();
      const shown = how ?? (showing === 'all' ? 'tinted' : showing);
      this.put(how === 'hidden' ? 'Hide' : 'Selection', { selection, showing: shown });
    } catch (error) {
      this.state.patch({ failure: failureOf(error) });
    } finally {
      this.state.patch({ busy: false });
    }
  }
}
