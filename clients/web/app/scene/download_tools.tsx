// Downloads: annotations, Gaussians, meshes, and masks of the segment.
import type { JSX } from 'preact';
import { useEffect, useMemo } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { FailureNote } from '../components/failure_note';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { saveCoco, saveMasks } from '../mask/save_files';
import { useStore } from '../store';
import { AnnotationTools } from './annotation_tools';
import type { SceneEverything } from './everything';
import { GaussianFiles } from './gaussian_files';
import type { SceneLabels } from './labels';
import { sizeOf } from './prompt';
import type { Watch } from './running_task';
import { RunningTask } from './running_task';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import { TaskProgress } from './task_progress';
import { masksOfThings, thingOf } from './things';

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  labels: SceneLabels;
  everything: SceneEverything;
  edits: GaussianEdits;
  views: readonly View[];
}

/** Masks of the current segment in all views. */
function SegmentFiles(props: Props & { running: RunningTask }): JSX.Element {
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
  const { session } = props;
  const running = useMemo(() => new RunningTask(), [session]);
  useEffect(() => () => running.cancel(), [running]);
  const { failure } = useStore(running.state);
  return (
    <section aria-labelledby="download-title">
      <h2 id="download-title">Download</h2>
      <TaskProgress running={running} />
      <FailureNote failure={failure} close={() => running.closeFailure()} />
      <AnnotationTools {...props} model={session.model} running={running} />
      <SegmentFiles {...props} running={running} />
      <GaussianFiles {...props} model={session.model} running={running} />
    </section>
  );
}
