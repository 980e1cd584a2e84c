// Downloads: annotations, Gaussians, meshes, and masks of the segment.
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
import { AnnotationTools } from './annotation_tools';
import type { SceneEverything } from './everything';
import { ExportProgress } from './export_progress';
import type { SceneLabels } from './labels';
import { MeshTools } from './mesh_tools';
import { sizeOf } from './prompt';
import type { Watch } from './running_export';
import { RunningExport } from './running_export';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import { masksOfThings, thingOf } from './things';

/** The files of Gaussians on offer. */
const gaussianFiles = [
  { word: 'PLY', ending: 'ply', format: GaussianFormat.PLY },
  { word: 'SPZ', ending: 'spz', format: GaussianFormat.SPZ },
  { word: 'glTF', ending: 'glb', format: GaussianFormat.GLB },
  { word: 'SOG', ending: 'sog', format: GaussianFormat.SOG },
  { word: 'web page', ending: 'html', format: GaussianFormat.HTML },
];

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  labels: SceneLabels;
  everything: SceneEverything;
  views: readonly View[];
}

/** Masks of the current segment in all views. */
function SegmentFiles(props: Props & { running: RunningExport }): JSX.Element {
  const { sceneId, session, labels, views, running } = props;
  const state = useStore(session.state);
  const named = useStore(labels.list);
  const { step } = useStore(running.state);
  const thing = thingOf(named, state);
  const segmented = (watch: Watch) =>
    masksOfThings(session.model, thing ? [thing] : [], session.views, watch);
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
  const isOff = step !== undefined || !thing;
  return (
    <fieldset>
      <legend>The segment in all photographs</legend>
      <div class="downloads">
        <button type="button" disabled={isOff} onClick={() => void savePngs()}>
          Masks (PNG)
        </button>
        <button type="button" disabled={isOff} onClick={() => void saveJson()}>
          COCO (JSON)
        </button>
      </div>
      {!thing && <p class="quiet">Segment a thing first.</p>}
    </fieldset>
  );
}

export function DownloadTools(props: Props): JSX.Element {
  const { sceneId, session, selections } = props;
  const { selection } = useStore(selections.state);
  const running = useMemo(() => new RunningExport(), [session]);
  useEffect(() => () => running.cancel(), [running]);
  const { step, failure } = useStore(running.state);
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
  return (
    <section aria-labelledby="download-title">
      <h2 id="download-title">Download</h2>
      <ExportProgress running={running} />
      <FailureNote failure={failure} close={() => running.closeFailure()} />
      <AnnotationTools {...props} model={session.model} running={running} />
      <SegmentFiles {...props} running={running} />
      <fieldset>
        <legend>Gaussians</legend>
        <div class="downloads">
          {gaussianButtons('Scene', sceneId)}
          {selection &&
            gaussianButtons('Selection', `${sceneId}-selection`, { selection: selection.name })}
        </div>
      </fieldset>
      <MeshTools
        sceneId={sceneId}
        model={session.model}
        selection={selection?.name}
        running={running}
      />
    </section>
  );
}
