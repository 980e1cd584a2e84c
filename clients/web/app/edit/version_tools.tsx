// The versions of a scene: which one is shown, the way back to another, and their deletion.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { countText, dateText } from '../format';
import type { History } from '../history';
import { useStore } from '../store';
import type { SceneEditor } from './scene_editor';
import type { SceneVersions } from './versions';
import { versionText } from './versions';

interface Props {
  /** Name of the model that is shown. */
  model: string;
  versions: SceneVersions;
  editor: SceneEditor;
  history: History;
}

export function VersionTools({ model, versions, editor, history }: Props): JSX.Element | null {
  const { list, failure } = useStore(versions.state);
  const { step } = useStore(editor.task.state);
  const [busy, setBusy] = useState(false);
  const [unmade, setUnmade] = useState<Failure>();
  const isOff = busy || step !== undefined;
  const run = async (act: () => Promise<void>) => {
    setBusy(true);
    setUnmade(undefined);
    try {
      await act();
    } catch (error) {
      setUnmade(failureOf(error));
    } finally {
      setBusy(false);
    }
  };
  const remove = async (name: string) => {
    await versions.remove(name);
    // It may lead to the deleted version.
    history.clear();
  };
  return (
    <section aria-labelledby="versions-title">
      <h2 id="versions-title">Versions</h2>
      {list.length < 2 && <p class="quiet">Each edit makes a version, to which you can go back.</p>}
      {busy && (
        <p class="quiet late" role="status">
          Waiting for the server …
        </p>
      )}
      <FailureNote failure={failure} close={() => versions.closeFailure()} />
      <FailureNote failure={unmade} close={() => setUnmade(undefined)} />
      {list.length > 1 && (
        <ol class="things versions">
          {list.map((version) => {
            const isShown = version.name === model;
            const text = versionText(version);
            return (
              <li key={version.name} aria-current={isShown ? 'true' : undefined}>
                <button
                  type="button"
                  class="thing"
                  title={`${text}. ${countText(version.numGaussians)} Gaussians`}
                  aria-pressed={isShown}
                  disabled={isOff}
                  onClick={() => !isShown && void run(() => editor.goTo(version.name, model))}
                >
                  <span class="name">{text}</span>
                  <span class="quiet">{dateText(version.createTime)}</span>
                </button>
                {!isShown && (
                  <ConfirmButton
                    class="bare"
                    sure="Delete?"
                    label={`Delete the version ${text}`}
                    disabled={isOff}
                    onConfirm={() => void run(() => remove(version.name))}
                  >
                    <Icon name="trash" />
                  </ConfirmButton>
                )}
              </li>
            );
          })}
        </ol>
      )}
    </section>
  );
}
