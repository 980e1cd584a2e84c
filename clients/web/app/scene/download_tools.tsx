// Downloads: PLY, masks, COCO JSON.
import type { JSX } from 'preact';
import { useEffect, useMemo } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { plyUrl } from '../api/clients';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { countText } from '../format';
import { saveCoco, saveMasks } from '../mask/save_files';
import { useStore } from '../store';
import type { SceneLabels } from './labels';
import type { Watch } from './mask_export';
import { MaskExport } from './mask_export';
import { sizeOf } from './prompt';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import { masksOfThings, thingsOf } from './things';

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  labels: SceneLabels;
  views: readonly View[];
}

/** What an export does now, how far it is, and a button that ends it. */
function ExportProgress({ running }: { running: MaskExport }): JSX.Element | null {
  const { step } = useStore(running.state);
  if (!step) return null;
  const { name, done, total } = step;
  return (
    <div class="row">
      <div class="export">
        <progress max={total} value={done} aria-label={name} />
        <span class="quiet" role="status">
          {name}: {countText(done)} of {countText(total)} masks
        </span>
      </div>
      <button type="button" onClick={() => running.cancel()}>
        Cancel
      </button>
    </div>
  );
}

export function DownloadTools(props: Props): JSX.Element {
  const { sceneId, session, selections, labels, views } = props;
  const state = useStore(session.state);
  const { selection } = useStore(selections.state);
  const named = useStore(labels.list);
  const maskExport = useMemo(() => new MaskExport(), [session]);
  useEffect(() => () => maskExport.cancel(), [maskExport]);
  const { step, failure } = useStore(maskExport.state);
  const things = thingsOf(named, state);
  const segmented = (watch: Watch) => masksOfThings(session.model, things, session.views, watch);
  const savePngs = () =>
    maskExport.run(async (steps) => {
      const found = await segmented(steps('Segmenting'));
      await saveMasks(sceneId, found, steps('Writing').progress);
    });
  const saveJson = () =>
    maskExport.run(async (steps) => {
      const sizes = views.map((view) => ({ view: view.view, ...sizeOf(view) }));
      saveCoco(sceneId, sizes, await segmented(steps('Segmenting')));
    });
  const nothing = step !== undefined || things.length === 0;
  const what =
    named.length > 0
      ? `of ${named.length} ${named.length === 1 ? 'label' : 'labels'}`
      : 'of the segment';
  return (
    <section aria-labelledby="download-title">
      <h2 id="download-title">Download</h2>
      <ExportProgress running={maskExport} />
      <div class="row wrap">
        <a
          class="button"
          href={plyUrl(session.model, { download: `${sceneId}.ply` })}
          download={`${sceneId}.ply`}
        >
          <Icon name="download" />
          Scene (PLY)
        </a>
        {selection && (
          <a
            class="button"
            href={plyUrl(session.model, {
              selection: selection.name,
              download: `${sceneId}-selection.ply`,
            })}
            download={`${sceneId}-selection.ply`}
          >
            <Icon name="download" />
            Selection (PLY)
          </a>
        )}
        <button
          type="button"
          disabled={nothing}
          onClick={() => void savePngs()}
        >
          <Icon name="download" />
          Masks (PNG)
        </button>
        <button
          type="button"
          disabled={nothing}
          onClick={() => void saveJson()}
        >
          <Icon name="download" />
          COCO (JSON)
        </button>
      </div>
      <p class="quiet">
        Masks and COCO: {what}, in all {views.length} views.
      </p>
      <FailureNote failure={failure} close={() => maskExport.closeFailure()} />
    </section>
  );
}
