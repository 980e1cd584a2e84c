// Finds things by a word, or all like the shown one, and lists them.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { useStore } from '../store';
import type { SceneFinder } from './finder';
import type { FoundThing, FoundThings } from './found_things';
import { colorOf, describeFound } from './found_things';
import type { SceneLabels } from './labels';
import { labelName } from './labels';
import { sizeOf } from './prompt';
import type { SceneSession } from './session';
import { usedGranularity } from './session_state';

interface Props {
  session: SceneSession;
  finder: SceneFinder;
  labels: SceneLabels;
  views: readonly View[];
  /** Whether the server has SAM, by which things that look alike are found. */
  hasSam: boolean;
  photoOf: (view: View) => string;
}

/** Finds all that look like the segment, which ends: all of them are shown. */
export function findAlike(session: SceneSession, finder: SceneFinder): void {
  const state = session.state.get();
  if (!state.prompt || !state.answer) return;
  void finder.findLike(state.prompt, usedGranularity(state));
  session.clear();
}

export function FindTools(props: Props): JSX.Element {
  const { session, finder, labels, hasSam } = props;
  const { answer, busy: segmenting } = useStore(session.state);
  const { word, busy, failure, found } = useStore(finder.state);
  const names = useStore(labels.list).map(labelName);
  const [text, setText] = useState('');
  const canBeAlike = hasSam && answer !== undefined && !segmenting && !busy;
  const isAlike = canBeAlike && text.trim() === '';
  const find = (wanted: string) => {
    const trimmed = wanted.trim();
    setText(wanted);
    if (trimmed === '') return;
    session.clear();
    void finder.findWord(trimmed);
  };
  return (
    <section aria-labelledby="find-title">
      <div class="row">
        <h2 id="find-title">Find</h2>
        <span class="spacer" />
        <button
          type="button"
          class="bare"
          disabled={!found && !busy}
          aria-label="Close what was found"
          title="Close what was found"
          onClick={() => finder.clear()}
        >
          <Icon name="close" />
        </button>
      </div>
      <form
        class="row"
        onSubmit={(event) => {
          event.preventDefault();
          if (isAlike) findAlike(session, finder);
          else find(text);
        }}
      >
        <input
          id="find-text"
          type="text"
          maxLength={200}
          list="find-words"
          placeholder={canBeAlike ? 'A word, or all like this' : 'By a word, such as “cup”'}
          aria-label="Find by a word"
          value={text}
          onInput={(event) => setText(event.currentTarget.value)}
        />
        <datalist id="find-words">
          {[...new Set([...names, ...(found?.knownWords ?? [])])].map((known) => (
            <option key={known} value={known} />
          ))}
        </datalist>
        <button
          type="submit"
          disabled={text.trim() === '' && !isAlike}
          aria-label={isAlike ? 'Find all like the segment' : 'Find'}
          title={isAlike ? 'Find all like the segment (A)' : 'Find'}
        >
          {isAlike ? 'All like this' : <Icon name="search" />}
        </button>
      </form>
      <p class={`quiet ${busy || found ? '' : 'gone'}`} role="status" aria-busy={busy}>
        {busy && 'Looking through the scene …'}
        {!busy && found && describeFound(found, word)}
      </p>
      <FailureNote failure={failure} close={() => finder.clear()} />
      {found && found.things.length > 0 && <FoundList {...props} found={found} />}
      {found && found.things.length === 0 && <Suggestions found={found} onPick={find} />}
    </section>
  );
}

/** What to ask instead, where nothing was found. */
function Suggestions({
  found: { didYouMean, knownWords },
  onPick,
}: {
  found: FoundThings;
  onPick: (word: string) => void;
}): JSX.Element {
  const chips = (words: readonly string[], label: string) => (
    <div class="chips" role="group" aria-label={label}>
      {words.map((word) => (
        <button key={word} type="button" class="chip" onClick={() => onPick(word)}>
          {word}
        </button>
      ))}
    </div>
  );
  return (
    <>
      {didYouMean.length > 0 && (
        <>
          <p class="quiet">Did you mean:</p>
          {chips(didYouMean, 'Did you mean')}
        </>
      )}
      {knownWords.length > 0 && (
        <details open={didYouMean.length === 0 && knownWords.length <= 12}>
          <summary>{`${knownWords.length} known ${knownWords.length === 1 ? 'word' : 'words'}`}</summary>
          {chips(knownWords, 'Known words')}
        </details>
      )}
    </>
  );
}

type ListProps = Props & { found: FoundThings };

function FoundList({ session, found: { things }, views, photoOf }: ListProps): JSX.Element {
  const { prompt } = useStore(session.state);
  return (
    <ol class="found">
      {things.map((thing, i) => (
        <li key={i}>
          <button
            type="button"
            aria-pressed={prompt === thing.prompt}
            style={{ '--swatch': `rgb(${colorOf(i).join(' ')})` }}
            onClick={() => session.pose(thing.prompt, thing.granularity)}
          >
            <Crop thing={thing} views={views} photoOf={photoOf} />
            <span class="number">{i + 1}</span>
            <span class="name">{thing.name || 'Thing'}</span>
            <span class="score" title="Score, from 0 to 1">
              {thing.score.toFixed(2)}
            </span>
          </button>
        </li>
      ))}
    </ol>
  );
}

/** The part of the photograph that shows a thing best. */
function Crop({
  thing: { appearances },
  views,
  photoOf,
}: { thing: FoundThing } & Pick<Props, 'views' | 'photoOf'>): JSX.Element {
  const [best] = appearances;
  const view = best && views.find((other) => other.view === best.view);
  if (!best || !view) return <span class="crop" />;
  const { width, height } = sizeOf(view);
  const around = `${best.x} ${best.y} ${Math.max(best.width, 1)} ${Math.max(best.height, 1)}`;
  return (
    <svg class="crop" viewBox={around} aria-hidden="true">
      <image href={photoOf(view)} width={width} height={height} />
    </svg>
  );
}
