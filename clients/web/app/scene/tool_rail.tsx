// The folded side panel: the tools as a column of buttons, and what the panel would say.
import type { JSX } from 'preact';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { useStore } from '../store';
import { describeAnswer } from './describe_answer';
import type { SceneFinder } from './finder';
import { describeFound } from './found_things';
import { PromptButtons, promptTools } from './segment_tools';
import type { SceneSelections } from './selections';
import type { SceneSession } from './session';
import type { Tool } from './use_drawing';

interface RailProps {
  session: SceneSession;
  tool: Tool;
  onTool: (tool: Tool) => void;
  onHelp: () => void;
}

export function ToolRail({ session, tool, onTool, onHelp }: RailProps): JSX.Element {
  return (
    <div class="rail">
      <div class="rail-tools" role="group" aria-label="What a click does">
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

interface StatusProps {
  session: SceneSession;
  finder: SceneFinder;
  selections: SceneSelections;
  /** Name of the shown view. */
  shown: string;
}

/** States and failures of all sections, over the panes while the panel is folded. */
export function FoldedStatus({ session, finder, selections, shown }: StatusProps): JSX.Element {
  const state = useStore(session.state);
  const finding = useStore(finder.state);
  const selecting = useStore(selections.state);
  const texts = [
    state.prompt && describeAnswer(state, shown, session.views),
    finding.busy && 'Looking through the scene …',
    !finding.busy && finding.found && describeFound(finding.found, finding.word),
    selecting.busy && 'Selecting: looking at the views …',
  ].filter(Boolean);
  return (
    <div class="folded-status">
      <FailureNote failure={state.failure} close={() => session.closeFailure()} />
      <FailureNote failure={finding.failure} close={() => finder.clear()} />
      <FailureNote failure={selecting.failure} close={() => selections.closeFailure()} />
      <p role="status" class={texts.length > 0 ? 'pane-note' : ''}>
        {texts.join(' ')}
      </p>
    </div>
  );
}
