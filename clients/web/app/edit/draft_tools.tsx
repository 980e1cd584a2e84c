// Numbers of a move, or a colour, of Gaussians; applied or dropped.
import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { Slider } from '../components/slider';
import type { Triple } from '../gaussians/crop_box';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import type { SceneSession } from '../scene/session';
import { useStore } from '../store';
import type { Draft, Drafting, MoveDraft, MoveMode, RecolorDraft } from './drafting';
import { editOf } from './drafting';
import type { Move } from './move';
import type { SceneEditor } from './scene_editor';

interface Props {
  session: Pick<SceneSession, 'model'>;
  edits: GaussianEdits;
  editor: SceneEditor;
  drafting: Drafting;
}

const modes: readonly { mode: MoveMode; name: string; title: string }[] = [
  { mode: 'translate', name: 'Move', title: 'The handles in 3D move it (G)' },
  { mode: 'rotate', name: 'Rotate', title: 'The handles in 3D turn it (R)' },
  { mode: 'scale', name: 'Scale', title: 'The handles in 3D scale it (S)' },
];
const axes = ['X', 'Y', 'Z'] as const;

/**
 * Makes the edit that a draft shows; the draft ends when the new model is shown. What was moved is picked there, so
 * that it can be moved on; of what was coloured, the tint of picks would hide the colour.
 */
export async function applyDraft({ session, edits, editor, drafting }: Props): Promise<void> {
  const draft = drafting.state.get();
  const edit = draft && editOf(draft);
  if (!draft || !edit || editor.task.state.get().step) return;
  const { picked } = edits.state.get().edits;
  const name = draft.kind === 'recolor' ? 'Recolour' : draft.copy ? 'Duplicate' : 'Move';
  const subject = { kind: 'picked', set: picked } as const;
  const isPicked = draft.kind === 'move';
  await editor.make({ name, model: session.model, subject, edit, isPicked });
}

interface NumberProps {
  id: string;
  name: string;
  value: number;
  step: number;
  onValue: (value: number) => void;
}

function NumberField({ id, name, value, step, onValue }: NumberProps): JSX.Element {
  return (
    <>
      <label for={id}>{name}</label>
      <input
        id={id}
        type="number"
        step={step}
        // Digits that a drag in 3D has, but nobody reads, are left out.
        value={Number(value.toPrecision(4))}
        onChange={(event) => {
          const next = event.currentTarget.valueAsNumber;
          if (Number.isFinite(next)) onValue(next);
          else event.currentTarget.value = `${value}`;
        }}
      />
    </>
  );
}

interface AxesProps {
  id: string;
  legend: string;
  step: number;
  values: Triple;
  onValues: (values: Triple) => void;
}

/** A number for each axis. */
function AxisFields({ id, legend, step, values, onValues }: AxesProps): JSX.Element {
  return (
    <fieldset>
      <legend>{legend}</legend>
      <div class="numbers">
        {axes.map((axis, i) => (
          <NumberField
            key={axis}
            id={`${id}-${axis}`}
            name={axis}
            step={step}
            value={values[i] as number}
            onValue={(value) => onValues(values.map((old, k) => (k === i ? value : old)) as never)}
          />
        ))}
      </div>
    </fieldset>
  );
}

function MoveFields({ draft, drafting }: { draft: MoveDraft; drafting: Drafting }): JSX.Element {
  const { translation, rotation, scale } = draft.move;
  const put = (move: Partial<Move>) => drafting.moveTo(move);
  return (
    <>
      <div class="segmented" role="group" aria-label="What the handles in 3D do">
        {modes.map(({ mode, name, title }) => (
          <button
            key={mode}
            type="button"
            title={title}
            aria-pressed={draft.mode === mode}
            onClick={() => drafting.setMode(mode)}
          >
            {name}
          </button>
        ))}
      </div>
      <AxisFields
        id="move"
        legend="Move by, scene units"
        step={0.01}
        values={translation}
        onValues={(to) => put({ translation: to })}
      />
      <AxisFields
        id="turn"
        legend="Rotate by, degrees"
        step={1}
        values={rotation}
        onValues={(to) => put({ rotation: to })}
      />
      <div class="numbers">
        <NumberField
          id="scale-by"
          name="Scale"
          value={scale}
          step={0.1}
          onValue={(to) => put({ scale: to })}
        />
      </div>
    </>
  );
}

function ColorFields({ draft, drafting }: { draft: RecolorDraft; drafting: Drafting }): JSX.Element {
  return (
    <>
      <label class="row">
        Colour
        <input
          type="color"
          value={draft.color}
          onInput={(event) => drafting.recolor({ color: event.currentTarget.value })}
        />
      </label>
      <Slider
        id="color-strength"
        name="Strength"
        text={`${Math.round(100 * draft.strength)} %`}
        min={0.05}
        max={1}
        step={0.05}
        value={draft.strength}
        onInput={(strength) => drafting.recolor({ strength })}
      />
    </>
  );
}

export function DraftTools(props: Props & { draft: Draft }): JSX.Element {
  const { draft, drafting, editor } = props;
  const { step } = useStore(editor.task.state);
  const form = useRef<HTMLFormElement>(null);
  const isOff = step !== undefined || !editOf(draft);
  // The button that began the draft is gone, and its focus with it.
  useEffect(() => {
    form.current?.querySelector<HTMLElement>('button, input')?.focus({ preventScroll: true });
    form.current?.scrollIntoView({ block: 'nearest' });
  }, [draft.kind]);
  const apply = (event: Event) => {
    event.preventDefault();
    void applyDraft(props);
  };
  return (
    <form ref={form} class="draft" noValidate onSubmit={apply}>
      {draft.kind === 'move' ? (
        <MoveFields draft={draft} drafting={drafting} />
      ) : (
        <ColorFields draft={draft} drafting={drafting} />
      )}
      <div class="downloads">
        <button type="submit" class="primary" disabled={isOff}>
          Apply
        </button>
        <button type="button" disabled={step !== undefined} onClick={() => drafting.end()}>
          Cancel
        </button>
      </div>
      {draft.kind === 'move' && isOff && !step && (
        <p class="quiet">Drag the handles in 3D, or type numbers.</p>
      )}
    </form>
  );
}
