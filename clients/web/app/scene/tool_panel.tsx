// The side panel of a scene: the tools of a prompt, what was found, the things and the downloads.
import type { JSX } from 'preact';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { FailureNote } from '../components/failure_note';
import type { Drafting } from '../edit/drafting';
import { EditTools } from '../edit/edit_tools';
import type { SceneEditor } from '../edit/scene_editor';
import { VersionTools } from '../edit/version_tools';
import type { SceneVersions } from '../edit/versions';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { GaussianTools } from '../gaussians/gaussian_tools';
import type { StoredPicks } from '../gaussians/stored_picks';
import { useStore } from '../store';
import { AfterTraining } from './after_training';
import type { Brush } from './brush';
import { describeAnswer } from './describe_answer';
import { DownloadTools } from './download_tools';
import type { SceneEverything } from './everything';
import { EverythingTools } from './everything_tools';
import { FindTools } from './find_tools';
import type { SceneFinder } from './finder';
import { HoverSwitch } from './hover_mask';
import { LabelTools } from './label_tools';
import type { SceneLabels } from './labels';
import { PieceTools } from './mask_tools';
import { sizeOf } from './prompt';
import type { SegmentNames } from './segment_names';
import { GranularityTools, HistoryNote, PromptButtons, PromptTools } from './segment_tools';
import { SelectionTools } from './selection_tools';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import type { ThingMasks } from './thing_masks';
import type { ThingsIn3d } from './things_in_3d';
import { HelpButton, ToolRail } from './tool_rail';
import type { Tool } from './use_drawing';

interface Props {
  sceneId: string;
  session: SceneSession;
  selections: SceneSelections;
  labels: SceneLabels;
  finder: SceneFinder;
  everything: SceneEverything;
  segmentNames: SegmentNames;
  things: ThingMasks;
  thingsIn3d: ThingsIn3d;
  edits: GaussianEdits;
  drafting: Drafting;
  storedPicks: StoredPicks;
  editor: SceneEditor;
  versions: SceneVersions;
  views: readonly View[];
  /** The shown view. */
  view: View;
  tool: Tool;
  onTool: (tool: Tool) => void;
  brush: Brush;
  onBrush: (brush: Brush) => void;
  onEverything: (isOn: boolean) => void;
  /** Makes a segment of the shown view the current one, by its id. */
  onPick: (id: number) => void;
  /** Whether the server has SAM. */
  hasSam: boolean;
  /** Whether the model is the newest state of a job, which answers prompts only. */
  isTraining: boolean;
  isOpen: boolean;
  photoOf: (view: View) => string;
  /** Shows the 3D view. */
  onShow3d: () => void;
  onHelp: () => void;
}

type SegmentProps = Pick<
  Props,
  'session' | 'view' | 'tool' | 'onTool' | 'brush' | 'onBrush' | 'hasSam' | 'isTraining' | 'onHelp'
>;

function SegmentSection(props: SegmentProps): JSX.Element {
  const { session, view, hasSam, isTraining, onHelp } = props;
  const state = useStore(session.state);
  const { prompt, failure, busy, looking } = state;
  return (
    <section aria-labelledby="segment-title">
      <div class="row">
        <h2 id="segment-title">Segment</h2>
        <span class="spacer" />
        <PromptButtons session={session} />
        <HelpButton onHelp={onHelp} />
      </div>
      <PromptTools {...props} viewWidth={sizeOf(view).width} />
      <p class={`quiet ${prompt ? 'said' : ''}`} role="status" aria-busy={busy || looking}>
        {prompt
          ? describeAnswer(state, view.view, session.views)
          : `Click a thing in the view${isTraining ? '' : ' or in 3D'}.`}
      </p>
      <FailureNote failure={failure} close={() => session.closeFailure()} />
      <HistoryNote history={session.history} />
      <GranularityTools session={session} hasSam={hasSam} />
      <PieceTools session={session} view={view.view} />
      <HoverSwitch session={session} />
    </section>
  );
}

/** Folded it is a rail of buttons; the sections stay, with their texts and running downloads. */
export function ToolPanel(props: Props): JSX.Element {
  const { isOpen, isTraining, session, selections, view } = props;
  return (
    <aside id="tools" class="tools" aria-label="Tools">
      {!isOpen && <ToolRail {...props} />}
      <div class="sections" hidden={!isOpen}>
        <SegmentSection {...props} />
        {isTraining ? (
          <AfterTraining />
        ) : (
          <>
            <EditTools {...props} />
            <EverythingTools {...props} onTurn={props.onEverything} />
            <FindTools {...props} />
            <LabelTools {...props} shownView={view.view} />
            <SelectionTools session={session} selections={selections} />
            <GaussianTools {...props} />
            <VersionTools {...props} model={session.model} history={session.history} />
            <DownloadTools {...props} />
          </>
        )}
      </div>
    </aside>
  );
}
