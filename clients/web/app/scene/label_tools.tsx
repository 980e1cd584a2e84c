// The things of a scene: segments with names (labels), which can be segmented in any view.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Label } from '../../gen/pepeseg/v1/label_service_pb';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { countText } from '../format';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { StoredPickList } from '../gaussians/stored_pick_tools';
import type { StoredPicks } from '../gaussians/stored_picks';
import { useStore } from '../store';
import { numViewsOf, viewsText } from './describe_answer';
import { colorOf } from './found_things';
import type { SceneLabels } from './labels';
import { labelName } from './labels';
import { nameSegment } from './name_segment';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import type { ThingMasks } from './thing_masks';
import type { ThingsIn3d } from './things_in_3d';

/** A label's pixels where it was named, and its number of views once they were looked at. */
function Extent({ area, numViews }: { area: bigint; numViews: number | undefined }): JSX.Element {
  return (
    <span class="quiet extent">
      <span>{countText(Number(area))} px</span>
      {numViews !== undefined && <span>{viewsText(numViews)}</span>}
    </span>
  );
}

interface Props {
  session: SceneSession;
  labels: SceneLabels;
  selections: SceneSelections;
  things: ThingMasks;
  thingsIn3d: ThingsIn3d;
  edits: GaussianEdits;
  storedPicks: StoredPicks;
  shownView: string;
}

type ShownProps = Pick<Props, 'things' | 'thingsIn3d' | 'labels' | 'selections'>;

/** Shows all named things in their colours, in the photograph and in 3D. */
function ShownTools(props: ShownProps): JSX.Element {
  const { things, thingsIn3d, labels, selections } = props;
  const { isOn, busy: looking } = useStore(things.state);
  const { isOn: isIn3d, busy, done, failure } = useStore(thingsIn3d.state);
  const total = useStore(labels.list).length;
  return (
    <>
      <div class="row wrap" role="group" aria-label="Where things have their colours">
        <span class="quiet">Coloured in</span>
        <button
          type="button"
          class="chip"
          aria-label="Things coloured in the photograph"
          aria-pressed={isOn}
          title="Things have their colours in the photograph (N)"
          onClick={() => things.turn(!isOn)}
        >
          Photograph
        </button>
        <button
          type="button"
          class="chip"
          aria-label="Things coloured in 3D"
          aria-pressed={isIn3d}
          title="Things have their colours in 3D; their Gaussians are selected first"
          onClick={() => {
            selections.show('all');
            thingsIn3d.turn(!isIn3d);
          }}
        >
          3D
        </button>
        {looking && !busy && (
          <span class="quiet late" role="status">
            Looking …
          </span>
        )}
        {busy && (
          <span class="quiet" role="status">
            {`Selecting: ${done} of ${total} …`}
          </span>
        )}
      </div>
      <FailureNote failure={failure} close={() => thingsIn3d.turn(false)} />
    </>
  );
}

/** Shows or hides one thing. */
function Eye({ things, label }: { things: ThingMasks; label: Label }): JSX.Element {
  const { hidden } = useStore(things.state);
  const isShown = !hidden.has(label.name);
  return (
    <button
      type="button"
      class="bare"
      aria-label={`Show ${labelName(label)}`}
      aria-pressed={isShown}
      title={isShown ? 'Hide its colour' : 'Show its colour'}
      onClick={() => things.toggle(label.name)}
    >
      <Icon name={isShown ? 'eye' : 'unseen'} />
    </button>
  );
}

export function LabelTools(props: Props): JSX.Element {
  const { session, labels, things, shownView } = props;
  const { prompt, answer, busy, looking } = useStore(session.state);
  const list = useStore(labels.list);
  const numViews = useStore(labels.numViews);
  const [text, setText] = useState('');
  /** Whether the name is entered, but not given yet. */
  const [isEntered, setEntered] = useState(false);
  const [failure, setFailure] = useState<Failure>();
  // A name that was begun goes with its segment.
  useEffect(() => {
    if (!prompt) setText('');
    setEntered(false);
  }, [prompt]);
  useEffect(() => {
    if (prompt?.kind !== 'label' || !answer || busy || looking) return;
    labels.saw(prompt.label, numViewsOf(answer));
  }, [labels, prompt, answer, busy, looking]);
  const mask = labels.maskToName(answer, shownView);
  const taken = labels.named(text);
  const run = async (act: () => Promise<void>) => {
    setFailure(undefined);
    try {
      await act();
    } catch (error) {
      setFailure(failureOf(error));
    }
  };
  // A name may be entered before the mask is there, and waits for it.
  const isNamable = mask !== undefined || busy;
  const isExact = prompt?.kind === 'mask' && prompt.isExact && prompt.place.view === shownView;
  // An exact mask is final in its view, whatever the other views wait for.
  const isLate = busy && !isExact;
  const giveName = () => {
    const said = text.trim();
    if (!mask || said === '' || taken) return;
    void run(async () => {
      try {
        await nameSegment(session, labels, said, mask);
      } catch (error) {
        setText((now) => now || said);
        throw error;
      }
    });
  };
  useEffect(() => {
    if (!isEntered || isLate) return;
    setEntered(false);
    giveName();
  }, [isEntered, isLate]);
  const enter = (event: Event) => {
    event.preventDefault();
    setEntered(true);
  };
  return (
    <section aria-labelledby="things-title">
      <h2 id="things-title">Things</h2>
      <form class="row" onSubmit={enter}>
        <input
          id="label-text"
          type="text"
          maxLength={200}
          placeholder={isNamable ? 'Name this segment' : 'Segment a thing first'}
          aria-label="Name of the segment"
          value={text}
          disabled={!isNamable}
          aria-invalid={taken !== undefined}
          aria-describedby={taken && 'label-taken'}
          onInput={(event) => setText(event.currentTarget.value)}
        />
        <button type="submit" disabled={!isNamable || text.trim() === '' || taken !== undefined}>
          Name
        </button>
      </form>
      {taken && (
        <p class="hint" id="label-taken" role="status">
          There is a label “{labelName(taken)}” already: take another name, or delete that one.
        </p>
      )}
      {isEntered && isLate && (
        <p class="quiet late" role="status">
          Waiting for the mask …
        </p>
      )}
      <FailureNote failure={failure} close={() => setFailure(undefined)} />
      {list.length > 0 && <ShownTools {...props} />}
      {list.length > 0 && (
        <ul class="things">
          {list.map((label, i) => (
            <li key={label.name} style={{ '--swatch': `rgb(${colorOf(i).join(' ')})` }}>
              <button
                type="button"
                class="thing"
                title={labelName(label)}
                aria-pressed={prompt?.kind === 'label' && prompt.label === label.name}
                onClick={() => session.pose({ kind: 'label', label: label.name })}
              >
                {labelName(label)}
              </button>
              <Eye things={things} label={label} />
              <Extent area={label.area} numViews={numViews.get(label.name)} />
              <ConfirmButton
                class="bare"
                sure="Delete?"
                label={`Delete the label ${labelName(label)}`}
                onConfirm={() => void run(() => labels.remove(label))}
              >
                <Icon name="trash" />
              </ConfirmButton>
            </li>
          ))}
        </ul>
      )}
      <StoredPickList {...props} />
    </section>
  );
}
