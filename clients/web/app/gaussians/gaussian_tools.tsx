// Gaussians that were picked, hidden or cut off in 3D: how many, and what to do with them.
import type { JSX } from 'preact';
import { useMemo } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { FailureNote } from '../components/failure_note';
import { bytesText, countText } from '../format';
import { useStore } from '../store';
import { CropTools } from './crop_tools';
import type { GaussianEdits, GaussianState } from './gaussian_edits';
import { sizeOfSet } from './gaussian_set';
import { sightsOf } from './sights';
import { StoreTools } from './stored_pick_tools';
import type { StoredPicks } from './stored_picks';

/** Returns what is waited for; empty: nothing. */
export function waitText({ loading, searching }: GaussianState): string {
  if (loading && loading.total > 0 && loading.done === loading.total) {
    return 'Reading the Gaussians …';
  }
  if (!loading) return searching ? 'Looking for floaters …' : '';
  const { done, total } = loading;
  const share = total > 0 ? `${bytesText(done)} of ${bytesText(total)}` : bytesText(done);
  return `Loading the Gaussians: ${share} …`;
}

/** Returns what is picked and hidden. */
function describe({ numPicked, numHidden, numFloaters, edits }: GaussianState, kept: number): string {
  const said: string[] = [];
  if (numFloaters === 0) said.push('No floaters found.');
  else if (numFloaters) said.push(`${countText(numFloaters)} floaters picked. Hide them?`);
  else if (numPicked > 0) said.push(`${countText(numPicked)} Gaussians picked.`);
  if (numHidden > 0) said.push(`${countText(numHidden)} hidden.`);
  if (edits.crop) said.push(`${countText(kept)} inside the box.`);
  if (said.length > 0) return said.join(' ');
  return 'Pick by box or lasso in 3D, however deep. Shift adds, Alt takes away.';
}

interface Props {
  edits: GaussianEdits;
  storedPicks: StoredPicks;
  views: readonly View[];
}

export function GaussianTools({ edits, storedPicks, views }: Props): JSX.Element {
  const state = useStore(edits.state);
  const { gaussians, edits: edited, numHidden, numFloaters, failure } = state;
  const { crop, hidden } = edited;
  const kept = useMemo(() => sizeOfSet(edits.kept()), [gaussians, crop, hidden]);
  const waits = waitText(state);
  return (
    <section aria-labelledby="gaussians-title">
      <h2 id="gaussians-title">Gaussians</h2>
      <p class="quiet" role="status">
        {waits || describe(state, kept)}
      </p>
      <FailureNote failure={failure} close={() => edits.closeFailure()} />
      <StoreTools edits={edits} storedPicks={storedPicks} />
      <div class="row wrap">
        <button
          type="button"
          disabled={waits !== ''}
          title="Pick Gaussians that are far from all others, or that no photograph shows"
          onClick={() => void edits.pickFloaters(sightsOf(views))}
        >
          Find floaters
        </button>
        {numFloaters !== undefined && numFloaters > 0 && (
          <button type="button" class="primary" onClick={() => edits.hidePicked()}>
            Hide floaters
          </button>
        )}
        <button
          type="button"
          class="chip"
          aria-pressed={crop !== undefined}
          title="Hide all outside a box (C)"
          onClick={() => void edits.turnCrop(crop === undefined)}
        >
          Crop box
        </button>
        {numHidden > 0 && (
          <button type="button" onClick={() => edits.showHidden()}>
            Show hidden
          </button>
        )}
      </div>
      {gaussians && crop && (
        <CropTools
          gaussians={gaussians}
          crop={crop}
          onCrop={(to) => edits.cropTo(to)}
          onRest={() => edits.restCrop()}
        />
      )}
    </section>
  );
}
