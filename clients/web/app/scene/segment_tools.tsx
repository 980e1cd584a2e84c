// The tools of a prompt: include, exclude, box; proposals; scale and threshold.
import type { JSX } from 'preact';
import { Icon } from '../components/icons';
import { countText } from '../format';
import { useStore } from '../store';
import type { Tool } from './photo_view';
import type { SceneSession } from './session';

const tools: readonly { tool: Tool; name: string; icon: 'plus' | 'minus' | 'box' }[] = [
  { tool: 'include', name: 'Include', icon: 'plus' },
  { tool: 'exclude', name: 'Exclude', icon: 'minus' },
  { tool: 'box', name: 'Box', icon: 'box' },
];

interface ToolsProps {
  tool: Tool;
  onTool: (tool: Tool) => void;
}

export function PromptTools({ tool, onTool }: ToolsProps): JSX.Element {
  return (
    <div class="segmented" role="group" aria-label="What a click does">
      {tools.map(({ tool: other, name, icon }) => (
        <button
          key={other}
          type="button"
          aria-pressed={tool === other}
          onClick={() => onTool(other)}
        >
          <Icon name={icon} />
          {name}
        </button>
      ))}
    </div>
  );
}

/** Buttons next to the title: undo, clear. */
export function PromptButtons({ session }: { session: SceneSession }): JSX.Element {
  const { prompt, canUndo } = useStore(session.state);
  return (
    <>
      <button
        type="button"
        class="bare"
        aria-label="Undo"
        title="Undo (Ctrl+Z)"
        disabled={!canUndo}
        onClick={() => session.undo()}
      >
        <Icon name="undo" />
      </button>
      <button
        type="button"
        class="bare"
        aria-label="Clear"
        title="Clear (Esc)"
        disabled={!prompt}
        onClick={() => session.clear()}
      >
        <Icon name="close" />
      </button>
    </>
  );
}

function Chips({ session }: { session: SceneSession }): JSX.Element | null {
  const { proposals, granularity } = useStore(session.state);
  const chosen = granularity.scale !== undefined || granularity.threshold !== undefined;
  if (proposals.length === 0) return null;
  return (
    <div class="chips" role="group" aria-label="What the click may mean">
      {proposals.map((proposal, i) => (
        <button
          key={i}
          type="button"
          class="chip"
          aria-pressed={
            chosen
              ? granularity.scale === proposal.scale && granularity.threshold === proposal.threshold
              : proposal.best
          }
          title={`${countText(proposal.mask.area)} pixels at scale ${proposal.scale.toFixed(2)}; key ${i + 1}`}
          onClick={() => session.choose(proposal)}
        >
          {proposal.name}
        </button>
      ))}
    </div>
  );
}

interface SliderProps {
  id: string;
  name: string;
  ends: readonly [string, string];
  min: number;
  max: number;
  value: number;
  chosen: boolean;
  disabled: boolean;
  onInput: (value: number) => void;
  /** Called when the slider is released. */
  onChange: () => void;
}

function Slider({ id, name, ends, chosen, value, onInput, ...input }: SliderProps): JSX.Element {
  return (
    <div class="slider">
      <label for={id}>{name}</label>
      <output for={id}>
        {input.disabled ? '' : `${value.toFixed(2)}${chosen ? '' : ' (auto)'}`}
      </output>
      <input
        id={id}
        type="range"
        step="0.005"
        value={value}
        onInput={(event) => onInput(Number(event.currentTarget.value))}
        {...input}
      />
      <span class="ends" aria-hidden="true">
        <span>{ends[0]}</span>
        <span>{ends[1]}</span>
      </span>
    </div>
  );
}

interface GranularityProps {
  session: SceneSession;
  /** Whether the server can let SAM place borders. */
  hasSam: boolean;
}

export function GranularityTools({ session, hasSam }: GranularityProps): JSX.Element {
  const { prompt, granularity, answer, busy } = useStore(session.state);
  return (
    <>
      <Chips session={session} />
      <Slider
        id="scale"
        name="Scale"
        ends={['a small part', 'the largest']}
        min={0}
        max={1}
        value={granularity.scale ?? answer?.scale ?? 0.5}
        chosen={granularity.scale !== undefined}
        disabled={!prompt}
        onInput={(scale) => session.drag({ scale })}
        onChange={() => session.rest()}
      />
      <details>
        <summary>More</summary>
        <Slider
          id="threshold"
          name="Similarity"
          ends={['more pixels', 'only similar pixels']}
          min={-1}
          max={1}
          value={granularity.threshold ?? answer?.threshold ?? 0.5}
          chosen={granularity.threshold !== undefined}
          disabled={!prompt}
          onInput={(threshold) => session.drag({ threshold })}
          onChange={() => session.rest()}
        />
        {hasSam && (
          <button
            type="button"
            disabled={!answer || busy}
            title="SAM places the border of this mask in the photograph; takes a second or two"
            onClick={() => void session.placeBorder()}
          >
            Border by SAM
          </button>
        )}
      </details>
    </>
  );
}
