// The selection in 3D: made from the segmentation, combined, hidden or shown alone.
import type { JSX } from 'preact';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { countText } from '../format';
import { useStore } from '../store';
import type { SceneSelections, Showing } from './selections';
import { operations } from './selections';
import type { SceneSession } from './session';
import { usedGranularity } from './session_state';

interface Props {
  session: SceneSession;
  selections: SceneSelections;
}

const showings: readonly [Showing, string][] = [
  ['all', 'Plain'],
  ['tinted', 'Tinted'],
  ['isolated', 'Only it'],
  ['hidden', 'Without'],
];

const combinations = [
  ['add', 'Add'],
  ['subtract', 'Subtract'],
  ['intersect', 'Intersect'],
] as const;

/** Selects with the shown answer's scale and threshold, so that the selection is what is seen. */
export function selectWith(
  session: SceneSession,
  selections: SceneSelections,
  how: keyof typeof operations,
): void {
  const state = session.state.get();
  if (!state.prompt || !state.answer) return;
  void selections.select(state.prompt, usedGranularity(state), operations[how]);
}

export function SelectionTools({ session, selections }: Props): JSX.Element {
  const { answer } = useStore(session.state);
  const { selection, showing, busy, failure } = useStore(selections.state);
  const ready = answer !== undefined && !busy;
  return (
    <section aria-labelledby="selection-title">
      <h2 id="selection-title">In 3D</h2>
      <div class="row wrap">
        <button
          type="button"
          class={selection ? '' : 'primary'}
          disabled={!ready}
          onClick={() => selectWith(session, selections, 'select')}
        >
          <Icon name="cube" />
          {selection ? 'Select again' : 'Select in 3D'}
        </button>
        {selection &&
          combinations.map(([how, name]) => (
            <button
              key={how}
              type="button"
              disabled={!ready}
              onClick={() => selectWith(session, selections, how)}
            >
              {name}
            </button>
          ))}
      </div>
      <p class="quiet" role="status">
        {busy && 'Looking at the views …'}
        {!busy && selection && `${countText(selection.numGaussians)} Gaussians selected.`}
        {!busy && !selection && 'Selects the segment’s Gaussians, to show alone, hide or export.'}
      </p>
      <FailureNote failure={failure} close={() => selections.closeFailure()} />
      {selection && (
        <div class="segmented" role="group" aria-label="How the selection is shown in 3D">
          {showings.map(([how, name]) => (
            <button
              key={how}
              type="button"
              aria-pressed={showing === how}
              onClick={() => selections.show(how)}
            >
              {name}
            </button>
          ))}
        </div>
      )}
    </section>
  );
}
