// Edits of a scene's models. Each makes a new model, which is shown then. To undo one is to make the model before
// it live.
import { scenes } from '../api/clients';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import type { History } from '../history';
import type { Steps } from '../scene/running_task';
import { RunningTask } from '../scene/running_task';
import type { EditRequest } from './edit_call';
import { editModel } from './edit_call';
import type { EditSubject } from './edit_subject';
import { bitsOfSelection, bitsOfSubject, withSubset } from './edit_subject';

export interface PlannedEdit {
  /** Name of the change in the history, as "Remove". */
  readonly name: string;
  readonly model: string;
  readonly subject: EditSubject;
  /** Whether all but the subject is edited. */
  readonly complement?: boolean;
  readonly edit: EditRequest['edit'];
  /** Whether what was changed or added is picked in the new model. */
  readonly isPicked: boolean;
}

/** What an edit begins and ends with. */
export interface EditorHost {
  /** Shows another model of the scene. */
  show(model: string): void;
  /** Called when the scene may have another list of models. */
  changed(): void;
}

export class SceneEditor {
  readonly task = new RunningTask();
  /** What is picked at first in models that an edit has made: bits as in GaussianBits, by the model's name. */
  private readonly picks = new Map<string, Uint8Array>();

  constructor(
    private readonly history: History,
    private readonly host: EditorHost,
  ) {}

  /** Makes an edit. Returns whether it was made; otherwise the task has the failure, unless it was cancelled. */
  async make(planned: PlannedEdit): Promise<boolean> {
    let isMade = false;
    await this.task.run(async (steps) => {
      isMade = await this.makeIn(planned, steps);
    });
    if (!isMade) this.host.changed();
    return isMade;
  }

  /** Picks the subject in 3D, so that it can be moved there. Returns whether that worked. */
  async pick(model: string, subject: EditSubject, edits: GaussianEdits): Promise<boolean> {
    if (subject.kind === 'picked') return true;
    let isPicked = false;
    await this.task.run(async (steps) => {
      const { signal, progress } = steps('Selecting', 'steps');
      progress(0, 0);
      const bits = await bitsOfSubject(model, subject, signal);
      await edits.pickBits(bits);
      signal.throwIfAborted();
      isPicked = edits.state.get().numPicked > 0;
      if (!isPicked) throw new Error('no Gaussians belong to it');
    });
    return isPicked;
  }

  /** Makes another model the live one and shows it; as a change of the history. */
  async goTo(model: string, before: string): Promise<void> {
    await this.setLive(model);
    this.remember('Version', before, model);
  }

  /** Returns what is picked at first in a model, once. */
  takePicks(model: string): Uint8Array | undefined {
    const bits = this.picks.get(model);
    this.picks.delete(model);
    return bits;
  }

  private async makeIn(planned: PlannedEdit, steps: Steps): Promise<boolean> {
    const { name, model, subject, complement = false, edit, isPicked } = planned;
    const { signal, progress } = steps('Selecting', 'steps');
    progress(0, 0);
    const result = await withSubset(model, subject, signal, async (of) => {
      const request = { model, subset: { of, complement }, edit };
      try {
        return await editModel(request as EditRequest, steps, signal);
      } catch (error) {
        throw signal.aborted ? error : finalError(error);
      }
    });
    if (isPicked && result.selection !== '') {
      // The edit was made, whether its Gaussians can be picked or not.
      const bits = await bitsOfSelection(result.selection).catch(() => undefined);
      if (bits) this.picks.set(result.model, bits);
    }
    this.remember(name, result.editedFrom, result.model);
    this.host.show(result.model);
    return true;
  }

  private remember(name: string, before: string, after: string): void {
    this.history.add({
      name,
      undo: () => this.setLive(before),
      redo: () => this.setLive(after),
    });
  }

  private async setLive(name: string): Promise<void> {
    const { liveModel } = await steadily(() => scenes.setLiveModel({ name }));
    this.host.show(liveModel);
  }
}

/** Returns the error of an edit, which is not repeated. Without an answer it may have been made all the same. */
function finalError(error: unknown): unknown {
  const { away, reason, what } = failureOf(error);
  if (!away) return error;
  const isRefused = reason !== '';
  return new Error(isRefused ? what : 'The connection was lost: the versions say whether the edit was made');
}
