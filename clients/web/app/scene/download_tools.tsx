// Downloads: PLY, masks, COCO JSON.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { lastId, plyUrl, segmentation } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import type { ViewMasks } from '../mask/coco';
import { saveCoco, saveMasks } from '../mask/save_files';
import { useStore } from '../store';
import { answerOf } from './answer';
import type { SceneLabels } from './labels';
import { labelName } from './labels';
import { segmentRequest, sizeOf } from './prompt';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  labels: SceneLabels;
  views: readonly View[];
}

/** Returns each label's masks in every view; without labels, the current segmentation. */
async function segmentsOf({ session, labels }: Props): Promise<ViewMasks[]> {
  const named = labels.list.get();
  if (named.length === 0) {
    const masks = [...(session.state.get().answer?.masks.values() ?? [])].filter(
      ({ view }) => view,
    );
    return masks.length > 0 ? [{ id: 'segment', category: 'segment', masks }] : [];
  }
  const segments: ViewMasks[] = [];
  for (const label of named) {
    const request = segmentRequest(session.model, { kind: 'label', label: label.name }, {}, 'all');
    const answer = answerOf(await steadily(() => segmentation.segmentViews(request)));
    const masks = [...answer.masks.values()];
    segments.push({ id: lastId(label.name), category: labelName(label), masks });
  }
  return segments;
}

export function DownloadTools(props: Props): JSX.Element {
  const { sceneId, session, selections, labels, views } = props;
  const { answer } = useStore(session.state);
  const { selection } = useStore(selections.state);
  const named = useStore(labels.list);
  const [busy, setBusy] = useState(false);
  const [failure, setFailure] = useState<Failure>();
  const save = async (how: (segments: ViewMasks[]) => unknown) => {
    setBusy(true);
    setFailure(undefined);
    try {
      await how(await segmentsOf(props));
    } catch (error) {
      setFailure(failureOf(error));
    } finally {
      setBusy(false);
    }
  };
  const sizes = () => views.map((view) => ({ view: view.view, ...sizeOf(view) }));
  const nothing = busy || (named.length === 0 && !answer);
  const what =
    named.length > 0
      ? `of ${named.length} ${named.length === 1 ? 'label' : 'labels'}`
      : 'of the segment';
  return (
    <section aria-labelledby="download-title">
      <h2 id="download-title">Download</h2>
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
          onClick={() => void save((all) => saveMasks(sceneId, all))}
        >
          <Icon name="download" />
          Masks (PNG)
        </button>
        <button
          type="button"
          disabled={nothing}
          onClick={() => void save((all) => saveCoco(sceneId, sizes(), all))}
        >
          <Icon name="download" />
          COCO (JSON)
        </button>
      </div>
      <p class="quiet">
        Masks and COCO: {what}, in all {views.length} views.
      </p>
      <FailureNote failure={failure} close={() => setFailure(undefined)} />
    </section>
  );
}
