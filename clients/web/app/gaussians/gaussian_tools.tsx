// Gaussians that were picked or hidden in 3D: how many, and their files.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { FailureNote } from '../components/failure_note';
import { bytesText, countText } from '../format';
import { saveBlob } from '../mask/save_files';
import { useStore } from '../store';
import type { GaussianEdits, GaussianState } from './gaussian_edits';
import type { GaussianSet } from './gaussian_set';
import { complementOf } from './gaussian_set';

/** Returns what is waited for; empty: nothing. */
export function loadingText({ loading }: Pick<GaussianState, 'loading'>): string {
  if (!loading) return '';
  const { done, total } = loading;
  const share = total > 0 ? `${bytesText(done)} of ${bytesText(total)}` : bytesText(done);
  return `Loading the Gaussians: ${share} …`;
}

interface Props {
  sceneId: string;
  edits: GaussianEdits;
}

export function GaussianTools({ sceneId, edits }: Props): JSX.Element {
  const state = useStore(edits.state);
  const { numPicked, numHidden, failure } = state;
  const { picked, hidden } = state.edits;
  const [writing, setWriting] = useState(false);
  const [unwritten, setUnwritten] = useState<Failure>();
  const save = async (set: GaussianSet, name: string) => {
    setWriting(true);
    setUnwritten(undefined);
    try {
      saveBlob(await edits.plyOf(set), name);
    } catch (error) {
      setUnwritten(failureOf(error));
    } finally {
      setWriting(false);
    }
  };
  const waits = loadingText(state) || (writing ? 'Writing the file …' : '');
  return (
    <section aria-labelledby="gaussians-title">
      <h2 id="gaussians-title">Gaussians</h2>
      <p class="quiet" role="status">
        {waits}
        {!waits && numPicked > 0 && `${countText(numPicked)} Gaussians picked.`}
        {!waits && numPicked === 0 && 'Picks by box or lasso in 3D, however deep. Shift adds, Alt subtracts.'}
        {!waits && numHidden > 0 && ` ${countText(numHidden)} hidden.`}
      </p>
      <FailureNote failure={failure} close={() => edits.closeFailure()} />
      <FailureNote failure={unwritten} close={() => setUnwritten(undefined)} />
      {(numPicked > 0 || numHidden > 0) && (
        <div class="row wrap">
          {numPicked > 0 && (
            <button
              type="button"
              disabled={writing}
              onClick={() => void save(picked, `${sceneId}-picked.ply`)}
            >
              Picked (PLY)
            </button>
          )}
          {numHidden > 0 && (
            <>
              <button type="button" onClick={() => edits.showHidden()}>
                Show hidden
              </button>
              <button
                type="button"
                disabled={writing}
                onClick={() => void save(complementOf(hidden), `${sceneId}-without-hidden.ply`)}
              >
                Without hidden (PLY)
              </button>
            </>
          )}
        </div>
      )}
    </section>
  );
}
