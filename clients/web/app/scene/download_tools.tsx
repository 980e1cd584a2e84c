// Downloads: Gaussians, masks, COCO JSON.
import type { JSX } from 'preact';
import { useEffect, useMemo } from 'preact/hooks';
import { GaussianFormat } from '../../gen/pepeseg/v1/render_service_pb';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { PlyOptions } from '../api/clients';
import { plyUrl } from '../api/clients';
import { fetchFile } from '../api/fetch_file';
import { FailureNote } from '../components/failure_note';
import { saveBlob, saveCoco, saveMasks } from '../mask/save_files';
import { useStore } from '../store';
import { ExportProgress } from './export_progress';
import type { SceneLabels } from './labels';
import { sizeOf } from './prompt';
import type { Watch } from './running_export';
import { RunningExport } from './running_export';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import { masksOfThings, thingsOf } from './things';

/** The files of Gaussians on offer. */
const gaussianFiles = [
  { word: 'PLY', ending: 'ply', format: GaussianFormat.PLY },
  { word: 'SPZ', ending: 'spz', format: GaussianFormat.SPZ },
  { word: 'glTF', ending: 'glb', format: GaussianFormat.GLB },
];

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  labels: SceneLabels;
  views: readonly View[];
}

export function DownloadTools(props: Props): JSX.Element {
  const { sceneId, session, selections, labels, views } = props;
  const state = useStore(session.state);
  const { selection } = useStore(selections.state);
  const named = useStore(labels.list);
  const running = useMemo(() => new RunningExport(), [session]);
  useEffect(() => () => running.cancel(), [running]);
  const { step, failure } = useStore(running.state);
  const things = thingsOf(named, state);
  const segmented = (watch: Watch) => masksOfThings(session.model, things, session.views, watch);
  const savePngs = () =>
    running.run(async (steps) => {
      const found = await segmented(steps('Segmenting', 'masks'));
      await saveMasks(sceneId, found, steps('Writing', 'masks').progress);
    });
  const saveJson = () =>
    running.run(async (steps) => {
      const sizes = views.map((view) => ({ view: view.view, ...sizeOf(view) }));
      saveCoco(sceneId, sizes, await segmented(steps('Segmenting', 'masks')));
    });
  const savePly = (name: string, part: PlyOptions) =>
    running.run(async (steps) => {
      const url = plyUrl(session.model, part);
      saveBlob(await fetchFile(url, steps('Downloading', 'bytes')), name);
    });
  const gaussianButtons = (title: string, stem: string, part?: PlyOptions) =>
    gaussianFiles.map(({ word, ending, format }) => (
      <button
        key={`${title} ${word}`}
        type="button"
        disabled={step !== undefined}
        onClick={() => void savePly(`${stem}.${ending}`, { ...part, format })}
      >
        {`${title} (${word})`}
      </button>
    ));
  const nothing = step !== undefined || things.length === 0;
  const what =
    named.length > 0
      ? `of ${named.length} ${named.length === 1 ? 'label' : 'labels'}`
      : 'of the segment';
  const hint =
    things.length > 0
      ? `Masks and COCO: ${what}, in all ${views.length} views.`
      : 'Masks and COCO: segment a thing first.';
  return (
    <section aria-labelledby="download-title">
      <h2 id="download-title">Download</h2>
      <ExportProgress running={running} />
      <div class="downloads">
        {gaussianButtons('Scene', sceneId)}
        {selection &&
          gaussianButtons('Selection', `${sceneId}-selection`, { selection: selection.name })}
        <button type="button" disabled={nothing} onClick={() => void savePngs()}>
          Masks (PNG)
        </button>
        <button type="button" disabled={nothing} onClick={() => void saveJson()}>
          COCO (JSON)
        </button>
      </div>
      <p class="quiet">{hint}</p>
      <FailureNote failure={failure} close={() => running.closeFailure()} />
    </section>
  );
}
