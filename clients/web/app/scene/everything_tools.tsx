// Shows all segments of the view, lists them, and hides or exports the picked one.
import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { plyUrl } from '../api/clients';
import { fetchFile } from '../api/fetch_file';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { countText } from '../format';
import { saveBlob } from '../mask/save_files';
import { useStore } from '../store';
import type { SceneEverything } from './everything';
import { RunningTask } from './running_task';
import type { SegmentNames } from './segment_names';
import type { Level, SegmentId } from './segments';
import { levelNames, sameSegment, seenSegments, segmentColor, segmentName } from './segments';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import { TaskProgress } from './task_progress';

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  everything: SceneEverything;
  segmentNames: SegmentNames;
  onTurn: (isOn: boolean) => void;
  /** Makes a segment of the shown view the current one. */
  onPick: (id: number) => void;
}

const levels: readonly Level[] = [0, 1, 2];
/** Waits that are shorter are not named. */
const shortMs = 300;

/** Returns the seconds since a time, counted up while `isOn`. */
function useSeconds(since: number, isOn: boolean): number {
  const [now, setNow] = useState(since);
  useEffect(() => {
    if (!isOn) return undefined;
    const timer = setInterval(() => setNow(Date.now()), shortMs);
    return () => clearInterval(timer);
  }, [since, isOn]);
  return Math.max(0, (now - since) / 1000);
}

/** What is waited for, and a button that ends it. */
function Waiting({ everything }: { everything: SceneEverything }): JSX.Element | null {
  const { waits, since } = useStore(everything.state);
  const seconds = useSeconds(since, waits !== 'nothing');
  if (waits === 'nothing' || seconds * 1000 < shortMs) return null;
  const what = waits === 'decomposition' ? 'Splitting the scene' : 'Drawing the segments';
  return (
    <div class="row">
      <div class="export">
        <progress aria-label={what} />
        <span class="quiet" role="status">
          {`${what}: ${Math.floor(seconds)} s`}
        </span>
      </div>
      <button type="button" onClick={() => everything.turn(false)}>
        Cancel
      </button>
    </div>
  );
}

type PickedProps = Omit<Props, 'onPick' | 'onTurn' | 'segmentNames'> & {
  segment: SegmentId;
  name: string;
};

/** Hides the picked segment in 3D, or saves it. */
function Picked(props: PickedProps): JSX.Element {
  const { sceneId, session, selections, everything, segment, name } = props;
  const { prompt } = useStore(session.state);
  const { busy } = useStore(selections.state);
  const running = useMemo(() => new RunningTask(), [session]);
  useEffect(() => () => running.cancel(), [running]);
  const { step, failure } = useStore(running.state);
  const hide = async () => {
    if (prompt?.kind === 'mask' && (await everything.hide(prompt, segment))) session.clear();
  };
  const save = () =>
    running.run(async (steps) => {
      const url = plyUrl(session.model, { segment });
      const ending = `${segmentName(segment).toLowerCase().replace(' ', '-')}.ply`;
      saveBlob(await fetchFile(url, steps('Downloading', 'bytes')), `${sceneId}-${ending}`);
    });
  return (
    <>
      <div class="row wrap">
        <span class="name">{name}</span>
        <span class="spacer" />
        {busy && (
          <span class="quiet late" role="status">
            Selecting …
          </span>
        )}
        <button type="button" class="chip" disabled={busy} onClick={() => void hide()}>
          Hide
        </button>
        <button type="button" class="chip" disabled={!!step} onClick={() => void save()}>
          Export (PLY)
        </button>
      </div>
      <TaskProgress running={running} />
      <FailureNote failure={failure} close={() => running.closeFailure()} />
    </>
  );
}

type ListProps = Pick<Props, 'everything' | 'segmentNames' | 'onPick'> & {
  picked: SegmentId | undefined;
};

function SegmentList(props: ListProps): JSX.Element | null {
  const { everything, segmentNames, onPick, picked } = props;
  const { seen } = useStore(everything.state);
  const found = useMemo(() => (seen ? seenSegments(seen.picture) : []), [seen]);
  if (!seen) return null;
  const { level } = seen;
  const kind = levelNames[level].toLowerCase();
  return (
    <details>
      <summary>{`${found.length} ${kind}${found.length === 1 ? '' : 's'} in this view`}</summary>
      <ul class="found segment-list">
        {found.map(({ id }) => (
          <li key={id}>
            <button
              type="button"
              aria-pressed={sameSegment(picked, { level, id })}
              style={{ '--swatch': `rgb(${segmentColor(id).join(' ')})` }}
              onClick={() => onPick(id)}
              onPointerEnter={() => everything.under.set(id)}
              onPointerLeave={() => everything.under.set(0)}
              onFocus={() => everything.under.set(id)}
              onBlur={() => everything.under.set(0)}
            >
              <span class="name">{segmentNames.get(id) ?? segmentName({ level, id })}</span>
              <span class="score">
                {everything.isHidden({ level, id })
                  ? 'hidden'
                  : `${countText(everything.numGaussians({ level, id }))} Gaussians`}
              </span>
            </button>
          </li>
        ))}
      </ul>
    </details>
  );
}

export function EverythingTools(props: Props): JSX.Element {
  const { session, selections, everything, segmentNames, onTurn } = props;
  const { isOn, level, seen, failure, hidden } = useStore(everything.state);
  const { prompt } = useStore(session.state);
  const picked = prompt?.kind === 'mask' ? (prompt.segment as SegmentId | undefined) : undefined;
  const nameOf = (segment: SegmentId) => {
    const named = segment.level === level ? segmentNames.get(segment.id) : undefined;
    return named ?? segmentName(segment);
  };
  return (
    <section aria-labelledby="everything-title">
      <div class="row">
        <h2 id="everything-title">Everything</h2>
        <span class="spacer" />
        <button
          type="button"
          class="chip"
          aria-pressed={isOn}
          title="Shows all segments of the view (G)"
          onClick={() => onTurn(!isOn)}
        >
          <Icon name="segments" /> Show all
        </button>
      </div>
      {isOn && (
        <div class="segmented" role="group" aria-label="Size of the segments">
          {levels.map((other) => (
            <button
              key={other}
              type="button"
              aria-pressed={other === level}
              onClick={() => everything.choose(other)}
            >
              {`${levelNames[other]}s`}
            </button>
          ))}
        </div>
      )}
      {isOn && <Waiting everything={everything} />}
      <FailureNote failure={failure} close={() => everything.closeFailure()} />
      {isOn && seen && !picked && (
        <p class="quiet">Click one in the photograph, to name, hide or export it.</p>
      )}
      {picked && <Picked {...props} segment={picked} name={nameOf(picked)} />}
      {isOn && <SegmentList {...props} picked={picked} />}
      {hidden.length > 0 && (
        <div class="row">
          <span class="quiet">{`${hidden.length} hidden in 3D.`}</span>
          <span class="spacer" />
          <button type="button" class="chip" onClick={() => selections.clear()}>
            Show them again
          </button>
        </div>
      )}
    </section>
  );
}
