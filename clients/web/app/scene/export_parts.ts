// The parts of a scene that are exported: all of it, or some of its Gaussians.
import type { EditSubject } from '../edit/edit_subject';
import { withSubset } from '../edit/edit_subject';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { useStore } from '../store';
import type { Steps } from './running_task';
import type { SceneSelections } from './selections';

export interface ExportPart {
  readonly id: 'scene' | 'selection' | 'picked' | 'kept';
  /** Name for people, as in "Picked (PLY)". */
  readonly title: string;
  /** Undefined: the whole scene. */
  readonly subject: EditSubject | undefined;
}

/** Returns the parts that there are now, the scene first. */
export function useExportParts(selections: SceneSelections, edits: GaussianEdits): ExportPart[] {
  const { selection } = useStore(selections.state);
  const { numPicked, numHidden, gaussians, edits: edited } = useStore(edits.state);
  const parts: ExportPart[] = [{ id: 'scene', title: 'Scene', subject: undefined }];
  if (selection) {
    const subject = { kind: 'selection', selection: selection.name } as const;
    parts.push({ id: 'selection', title: 'Selection', subject });
  }
  if (numPicked > 0) {
    parts.push({ id: 'picked', title: 'Picked', subject: { kind: 'picked', set: edited.picked } });
  }
  if (gaussians && (numHidden > 0 || edited.crop)) {
    const title = edited.crop ? 'Inside' : 'Without hidden';
    parts.push({ id: 'kept', title, subject: { kind: 'picked', set: edits.kept() } });
  }
  return parts;
}

/** Calls `act` with the name of a selection of the part, which is there until `act` ends; undefined: the scene. */
export async function withSelection<T>(
  model: string,
  { subject }: ExportPart,
  steps: Steps,
  act: (selection: string | undefined) => Promise<T>,
): Promise<T> {
  if (!subject) return act(undefined);
  const { signal, progress } = steps('Selecting', 'steps');
  progress(0, 0);
  return withSubset(model, subject, signal, ({ value }) => act(value as string));
}
