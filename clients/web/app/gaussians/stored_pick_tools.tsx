// Picks in 3D with names: the field that names them, and the list of those of the model.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Selection } from '../../gen/pepeseg/v1/selection_service_pb';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { countText } from '../format';
import { useStore } from '../store';
import type { GaussianEdits } from './gaussian_edits';
import type { StoredPicks } from './stored_picks';
import { isHidden } from './stored_picks';

interface Props {
  edits: GaussianEdits;
  storedPicks: StoredPicks;
}

/** Names what is picked, and stores it. */
export function StoreTools({ edits, storedPicks }: Props): JSX.Element | null {
  const { numPicked } = useStore(edits.state);
  const { waits } = useStore(storedPicks.state);
  const [text, setText] = useState('');
  // A name that was begun goes with its picks.
  useEffect(() => {
    if (numPicked === 0) setText('');
  }, [numPicked]);
  if (numPicked === 0) return null;
  const store = async (event: Event) => {
    event.preventDefault();
    const said = text.trim();
    if (said === '' || waits !== '') return;
    setText('');
    if (!(await storedPicks.store(said))) setText((now) => now || said);
  };
  return (
    <form class="row" onSubmit={(event) => void store(event)}>
      <input
        id="picks-name"
        type="text"
        maxLength={80}
        placeholder="Name what is picked"
        aria-label="Name of what is picked"
        value={text}
        onInput={(event) => setText(event.currentTarget.value)}
      />
      <button type="submit" disabled={text.trim() === '' || waits !== ''}>
        Store
      </button>
    </form>
  );
}

/** A stored selection: it is picked again, hidden or deleted. */
function StoredPick({ selection, edits, storedPicks }: Props & { selection: Selection }): JSX.Element {
  const { sets, waits } = useStore(storedPicks.state);
  const { edits: edited } = useStore(edits.state);
  const { name, displayName, numGaussians } = selection;
  const set = sets.get(name);
  const isShown = !isHidden(set, edited.hidden);
  const isOff = waits !== '';
  return (
    <li>
      <button
        type="button"
        class="thing"
        title={displayName}
        aria-pressed={set !== undefined && set === edited.picked}
        disabled={isOff}
        onClick={() => void storedPicks.choose(selection)}
      >
        {displayName}
      </button>
      <button
        type="button"
        class="bare"
        aria-label={`Show ${displayName} in 3D`}
        aria-pressed={isShown}
        title={isShown ? 'Hide it in 3D' : 'Show it in 3D'}
        disabled={isOff}
        onClick={() => void storedPicks.toggle(selection)}
      >
        <Icon name={isShown ? 'eye' : 'unseen'} />
      </button>
      <span class="quiet extent">
        <span>{countText(numGaussians)}</span>
        <span>Gaussians</span>
      </span>
      <ConfirmButton
        class="bare"
        sure="Delete?"
        label={`Delete the picks ${displayName}`}
        disabled={isOff}
        onConfirm={() => void storedPicks.remove(selection)}
      >
        <Icon name="trash" />
      </ConfirmButton>
    </li>
  );
}

export function StoredPickList(props: Props): JSX.Element | null {
  const { list, waits, failure } = useStore(props.storedPicks.state);
  return (
    <>
      {waits !== '' && (
        <p class="quiet late" role="status">
          {`${waits} …`}
        </p>
      )}
      <FailureNote failure={failure} close={() => props.storedPicks.closeFailure()} />
      {list.length > 0 && (
        <ul class="things stored" aria-label="Picks with names">
          {list.map((selection) => (
            <StoredPick key={selection.name} {...props} selection={selection} />
          ))}
        </ul>
      )}
    </>
  );
}
