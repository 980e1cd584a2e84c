// Labels: names for segments, which can be segmented in any view.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { useStore } from '../store';
import type { SceneLabels } from './labels';
import { labelName } from './labels';
import { nameSegment } from './name_segment';
import type { SceneSession } from './session';

interface Props {
  session: SceneSession;
  labels: SceneLabels;
  shownView: string;
}

export function LabelTools({ session, labels, shownView }: Props): JSX.Element {
  const { prompt, answer, busy } = useStore(session.state);
  const list = useStore(labels.list);
  const [text, setText] = useState('');
  const [failure, setFailure] = useState<Failure>();
  // A name that was begun goes with its segment.
  useEffect(() => {
    if (!prompt) setText('');
  }, [prompt]);
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
  const name = (event: Event) => {
    event.preventDefault();
    const said = text.trim();
    if (!mask || busy || said === '' || taken) return;
    void run(async () => {
      try {
        await nameSegment(session, labels, said, mask);
      } catch (error) {
        setText((now) => now || said);
        throw error;
      }
    });
  };
  return (
    <section aria-labelledby="labels-title">
      <h2 id="labels-title">Labels</h2>
      <form class="row" onSubmit={name}>
        <input
          id="label-text"
          type="text"
          maxLength={200}
          placeholder={mask ? 'Name this segment' : 'Segment a thing first'}
          aria-label="Name of the segment"
          value={text}
          disabled={!mask}
          aria-invalid={taken !== undefined}
          aria-describedby={taken && 'label-taken'}
          onInput={(event) => setText(event.currentTarget.value)}
        />
        <button type="submit" disabled={!mask || busy || text.trim() === '' || taken !== undefined}>
          Name
        </button>
      </form>
      {taken && (
        <p class="hint" id="label-taken" role="status">
          There is a label “{labelName(taken)}” already: take another name, or delete that one.
        </p>
      )}
      <FailureNote failure={failure} close={() => setFailure(undefined)} />
      {list.length > 0 && (
        <ul class="labels">
          {list.map((label) => (
            <li key={label.name}>
              <button
                type="button"
                class="chip"
                aria-pressed={prompt?.kind === 'label' && prompt.label === label.name}
                onClick={() => session.pose({ kind: 'label', label: label.name })}
              >
                {labelName(label)}
              </button>
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
    </section>
  );
}
