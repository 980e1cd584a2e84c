// The folded side panel: the tools as a column of buttons, and what the panel would say.
import type { JSX } from 'preact';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import type { Drafting } from '../edit/drafting';
import type { SceneEditor } from '../edit/scene_editor';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { waitText } from '../gaussians/gaussian_tools';
import { useStore } from '../store';
import { describeAnswer } from './describe_answer';
import type { SceneEverything } from './everything';
import type { SceneFinder } from './finder';
import { describeFound } from './found_things';
import { HistoryNote, PromptButtons, promptTools } from './segment_tools';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import { TaskProgress } from './task_progress';
import type { ThingsIn3d } from './things_in_3d';
import type { Tool } from './use_drawing';

interface RailProps {
  session: SceneSession;
  everything: SceneEverything;
  onEverything: (isOn: boolean) => void;
  isTraining: boolean;
  tool: Tool;
  onTool: (tool: Tool) => void;
  onHelp: () => void;
}

export function ToolRail(props: RailProps): JSX.Element {
  const { session, everything, onEverything, isTraining, tool, onTool, onHelp } = props;
  const { isOn } = useStore(everything.state);
  return (
    <div class="rail">
      <div class="rail-tools" role="group" aria-label="What the pointer does">
        {promptTools.map(({ tool: other, name, icon, key }) => (
          <button
            key={other}
            type="button"
            class="bare"
            aria-label={name}
            title={`${name} (${key})`}
            aria-pressed={tool === other}
            onClick={() => onTool(other)}
          >
            <Icon name={icon} />
          </button>
        ))}
      </div>
      <button
        type="button"
        class="bare"
        aria-label="Everything"
        title={isTraining ? 'Everything: after the training' : 'Everything: all segments of the view (G)'}
        aria-pressed={isOn}
        disabled={isTraining}
        onClick={() => onEverything(!isOn)}
      >
        <Icon name="segments" />
      </button>
      <PromptButtons session={session} />
      <HelpButton onHelp={onHelp} />
    </div>
  );
}

export function HelpButton({ onHelp }: { onHelp: () => void }): JSX.Element {
  return (
    <button
      type="button"
      class="bare"
      aria-label="Keyboard and mouse"
      title="Keyboard and mouse (?)"
      onClick={onHelp}
    >
      <Icon name="help" />
    </button>
  );
}

const waitTexts = {
  nothing: '',
  decomposition: 'Splitting the scene …',
  picture: 'Drawing the segments …',
} as const;

interface StatusProps {
  session: SceneSession;
  finder: SceneFinder;
  selections: SceneSelections;
  everything: SceneEverything;
  thingsIn3d: ThingsIn3d;
  edits: GaussianEdits;
  editor: SceneEditor;
  drafting: Drafting;
  /** Name of the shown view. */
  shown: string;
}

/** States and failures of all sections, over the panes while the panel is folded. */
export function FoldedStatus(props: StatusProps): JSX.Element {
  const { session, finder, selections, everything, thingsIn3d, edits, shown } = props;
  const { task } = props.editor;
  const draft = useStore(props.drafting.state);
  const { step, failure: unedited } = useStore(task.state);
  const state = useStore(session.state);
  const finding = useStore(finder.state);
  const selecting = useStore(selections.state);
  const colouring = useStore(thingsIn3d.state);
  const splitting = useStore(everything.state);
  const picking = useStore(edits.state);
  const texts = [
    state.prompt && describeAnswer(state, shown, session.views),
    finding.busy && 'Looking through the scene …',
    !finding.busy && finding.found && describeFound(finding.found, finding.word),
    waitTexts[splitting.waits],
    colouring.busy && 'Selecting the things …',
    selecting.busy && 'Selecting: looking at the views …',
    waitText(picking),
    draft?.kind === 'move' && 'Enter makes the move, Esc drops it.',
  ].filter(Boolean);
  return (
    <div class="folded-status">
      <FailureNote failure={state.failure} close={() => session.closeFailure()} />
      <HistoryNote history={session.history} />
      <FailureNote failure={finding.failure} close={() => finder.clear()} />
      <FailureNote failure={selecting.failure} close={() => selections.closeFailure()} />
      <FailureNote failure={splitting.failure} close={() => everything.closeFailure()} />
      <FailureNote failure={picking.failure} close={() => edits.closeFailure()} />
      <FailureNote failure={unedited} close={() => task.closeFailure()} />
      {step && (
        <div class="note">
          <TaskProgress running={task} />
        </div>
      )}
      <p role="status" class={texts.length > 0 ? 'pane-note' : ''}>
        {texts.join(' ')}
      </p>
    </div>
  );
}
