// Edits of the current thing: removed, moved, copied, coloured, or kept alone.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { FailureNote } from '../components/failure_note';
import { countText } from '../format';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import type { SceneLabels } from '../scene/labels';
import { labelName } from '../scene/labels';
import type { SceneSelections } from '../scene/selections';
import type { SceneSession } from '../scene/session';
import { usedGranularity } from '../scene/session_state';
import { TaskProgress } from '../scene/task_progress';
import { useStore } from '../store';
import { DraftTools } from './draft_tools';
import type { DraftedEdit, Drafting } from './drafting';
import type { EditSubject } from './edit_subject';
import type { PlannedEdit, SceneEditor } from './scene_editor';

interface Props {
  session: SceneSession;
  labels: SceneLabels;
  selections: SceneSelections;
  edits: GaussianEdits;
  editor: SceneEditor;
  drafting: Drafting;
  /** Shows the 3D view, in which drafts are seen. */
  onShow3d: () => void;
}

type Kind = EditSubject['kind'];

const kindNames: Readonly<Record<Kind, string>> = {
  picked: 'Picked',
  segment: 'Segment',
  selection: 'Selection',
};

/** Returns what can be edited, and each one's text. Gaussians that were picked come first. */
function useSubjects({ session, labels, selections, edits }: Props): (EditSubject & { text: string })[] {
  const state = useStore(session.state);
  const { selection } = useStore(selections.state);
  const named = useStore(labels.list);
  const { numPicked, edits: edited } = useStore(edits.state);
  const subjects: (EditSubject & { text: string })[] = [];
  if (numPicked > 0) {
    const text = `${countText(numPicked)} picked Gaussians.`;
    subjects.push({ kind: 'picked', set: edited.picked, text });
  }
  const { prompt, answer } = state;
  if (prompt && answer) {
    const granularity = usedGranularity(state);
    const label = prompt.kind === 'label' && named.find(({ name }) => name === prompt.label);
    const text = label ? `“${labelName(label)}”.` : 'The segment.';
    subjects.push({ kind: 'segment', prompt, granularity, text });
  }
  if (selection && selection.numGaussians > 0n) {
    const text = `The selection: ${countText(selection.numGaussians)} Gaussians.`;
    subjects.push({ kind: 'selection', selection: selection.name, text });
  }
  return subjects;
}

export function EditTools(props: Props): JSX.Element {
  const { session, edits, editor, drafting } = props;
  const { model } = session;
  const subjects = useSubjects(props);
  const [kind, setKind] = useState<Kind>();
  const [fill, setFill] = useState(true);
  const { step, failure } = useStore(editor.task.state);
  const draft = useStore(drafting.state);
  const subject = subjects.find((other) => other.kind === kind) ?? subjects[0];
  const isOff = step !== undefined;
  const buttons = useRef<HTMLDivElement>(null);
  const drafted = useRef(draft);
  useEffect(() => setKind(undefined), [model]);
  useEffect(() => {
    // The draft's form had the focus, and is gone.
    const isLost = document.activeElement === document.body;
    if (drafted.current && !draft && isLost) buttons.current?.querySelector('button')?.focus();
    drafted.current = draft;
  }, [draft]);
  const make = (name: string, edit: PlannedEdit['edit'], complement = false) => {
    if (subject) void editor.make({ name, model, subject, complement, edit, isPicked: false });
  };
  /** Begins an edit that is shown in 3D first: what it is about is picked there. */
  const begin = async (drafted: DraftedEdit) => {
    if (!subject || !(await editor.pick(model, subject, edits))) return;
    await edits.load();
    props.onShow3d();
    drafting.begin(drafted);
  };
  return (
    <section aria-labelledby="edit-title">
      <h2 id="edit-title">Edit</h2>
      {!draft && subjects.length > 1 && (
        <div class="segmented" role="group" aria-label="What is edited">
          {subjects.map((other) => (
            <button
              key={other.kind}
              type="button"
              aria-pressed={other.kind === subject?.kind}
              onClick={() => setKind(other.kind)}
            >
              {kindNames[other.kind]}
            </button>
          ))}
        </div>
      )}
      <p class="quiet">
        {subject?.text ?? 'Click a thing, or pick Gaussians in 3D, to remove, move or colour it.'}
      </p>
      <TaskProgress running={editor.task} />
      <FailureNote failure={failure} close={() => editor.task.closeFailure()} />
      {draft && <DraftTools {...props} draft={draft} />}
      {subject && !draft && (
        <div ref={buttons} class="edits">
          <button
            type="button"
            disabled={isOff}
            onClick={() => make('Remove', { case: 'remove', value: { fill } })}
          >
            Remove
          </button>
          <button type="button" disabled={isOff} onClick={() => void begin('move')}>
            Move
          </button>
          <button type="button" disabled={isOff} onClick={() => void begin('copy')}>
            Duplicate
          </button>
          <button type="button" disabled={isOff} onClick={() => void begin('recolor')}>
            Recolour
          </button>
          <button
            type="button"
            class="wide"
            disabled={isOff}
            title="Removes everything else"
            onClick={() => make('Keep only this', { case: 'remove', value: {} }, true)}
          >
            Keep only this
          </button>
          <label class="check" title="Continues the surroundings where the thing was">
            <input
              type="checkbox"
              checked={fill}
              onChange={(event) => setFill(event.currentTarget.checked)}
            />
            Fill the hole
          </label>
        </div>
      )}
    </section>
  );
}
