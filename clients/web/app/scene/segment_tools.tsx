// The tools of a prompt and of its mask; its size; scale, threshold and SAM.
import type { JSX } from 'preact';
import { FailureNote } from '../components/failure_note';
import type { IconName } from '../components/icons';
import { Icon } from '../components/icons';
import { Slider } from '../components/slider';
import type { History } from '../history';
import { useStore } from '../store';
import type { Brush } from './brush';
import { maxBrush, minBrush, strokeWidth, withWidth } from './brush';
import { describeRung } from './ladder';
import type { SamClicks } from './segment_views';
import type { SceneSession } from './session';
import type { Tool } from './use_drawing';
import { isWide } from './use_drawing';

interface PromptTool {
  readonly tool: Tool;
  readonly name: string;
  readonly icon: IconName;
  /** The key that chooses it. */
  readonly key: string;
}

export const promptTools: readonly PromptTool[] = [
  { tool: 'include', name: 'Include', icon: 'plus', key: 'I' },
  { tool: 'exclude', name: 'Exclude', icon: 'minus', key: 'E' },
  { tool: 'box', name: 'Box', icon: 'box', key: 'R' },
  { tool: 'brush', name: 'Brush', icon: 'brush', key: 'D' },
  { tool: 'lasso', name: 'Lasso', icon: 'lasso', key: 'F' },
  { tool: 'paint', name: 'Paint', icon: 'paint', key: 'J' },
  { tool: 'erase', name: 'Erase', icon: 'erase', key: 'K' },
];

interface ToolsProps {
  tool: Tool;
  onTool: (tool: Tool) => void;
  brush: Brush;
  onBrush: (brush: Brush) => void;
  /** Width of the shown view, pixels. */
  viewWidth: number;
}

export function PromptTools({ tool, onTool, ...brushing }: ToolsProps): JSX.Element {
  return (
    <>
      <div class="segmented stacked" role="group" aria-label="What the pointer does">
        {promptTools.map(({ tool: other, name, icon, key }) => (
          <button
            key={other}
            type="button"
            title={`${name} (${key})`}
            aria-pressed={tool === other}
            onClick={() => onTool(other)}
          >
            <Icon name={icon} />
            {name}
          </button>
        ))}
      </div>
      {isWide(tool) && <BrushTools {...brushing} isPrompt={tool === 'brush'} />}
    </>
  );
}

interface BrushProps extends Pick<ToolsProps, 'brush' | 'onBrush' | 'viewWidth'> {
  /** Whether it draws over what is meant or not, rather than on the mask. */
  isPrompt: boolean;
}

function BrushTools({ brush, onBrush, viewWidth, isPrompt }: BrushProps): JSX.Element {
  return (
    <>
      {isPrompt && <BrushSides brush={brush} onBrush={onBrush} />}
      <Slider
        id="brush-width"
        name="Width"
        text={`${Math.round(strokeWidth(brush, viewWidth))} pixels`}
        min={minBrush}
        max={maxBrush}
        step={1}
        value={brush.width}
        onInput={(value) => onBrush(withWidth(brush, value))}
      />
    </>
  );
}

function BrushSides({ brush, onBrush }: Pick<BrushProps, 'brush' | 'onBrush'>): JSX.Element {
  const sides = [
    { negative: false, icon: 'plus', name: 'What is meant' },
    { negative: true, icon: 'minus', name: 'What is not' },
  ] as const;
  return (
    <div class="segmented" role="group" aria-label="What the brush draws over">
      {sides.map(({ negative, icon, name }) => (
        <button
          key={name}
          type="button"
          aria-pressed={brush.negative === negative}
          onClick={() => onBrush({ ...brush, negative })}
        >
          <Icon name={icon} /> {name}
        </button>
      ))}
    </div>
  );
}

/** Buttons next to the title: undo, redo, clear. */
export function PromptButtons({ session }: { session: SceneSession }): JSX.Element {
  const { prompt } = useStore(session.state);
  const { history } = session;
  const { undo, redo, busy } = useStore(history.state);
  return (
    <>
      <button
        type="button"
        class="bare"
        aria-label="Undo"
        title={undo ? `Undo: ${undo} (Ctrl+Z)` : 'Undo (Ctrl+Z)'}
        disabled={!undo || busy}
        onClick={() => void history.undo()}
      >
        <Icon name="undo" />
      </button>
      <button
        type="button"
        class="bare"
        aria-label="Redo"
        title={redo ? `Redo: ${redo} (Ctrl+Shift+Z)` : 'Redo (Ctrl+Shift+Z)'}
        disabled={!redo || busy}
        onClick={() => void history.redo()}
      >
        <Icon name="redo" />
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

/** Says that the server undoes something, and what went wrong then. */
export function HistoryNote({ history }: { history: History }): JSX.Element {
  const { busy, failure } = useStore(history.state);
  return (
    <>
      {busy && (
        <p class="quiet late" role="status">
          Undoing or redoing …
        </p>
      )}
      <FailureNote failure={failure} close={() => history.closeFailure()} />
    </>
  );
}

/** Goes along the sizes that the prompt may mean. */
function SizeSlider({ session }: { session: SceneSession }): JSX.Element {
  const { ladder } = useStore(session.state);
  const { rungs, at, isCurrent } = ladder;
  return (
    <Slider
      id="size"
      name="Size"
      text={describeRung(ladder)}
      ends={['smaller', 'larger']}
      min={0}
      max={Math.max(1, rungs.length - 1)}
      step={1}
      value={at ?? 0}
      disabled={!isCurrent || rungs.length < 2}
      onInput={(index) => session.climb(index)}
      onChange={() => session.rest()}
    />
  );
}

interface GranularityProps {
  session: SceneSession;
  /** Whether the server has SAM. */
  hasSam: boolean;
}

/** Scale and threshold, which the size slider sets together. */
function MoreTools({ session, hasSam }: GranularityProps): JSX.Element {
  const { prompt, granularity, answer, busy } = useStore(session.state);
  const { scale = answer?.scale ?? 0.5, threshold = answer?.threshold ?? 0.5 } = granularity;
  const said = (value: number, chosen: number | undefined) =>
    prompt ? `${value.toFixed(2)}${chosen === undefined ? ' (auto)' : ''}` : '';
  return (
    <details>
      <summary>More</summary>
      <Slider
        id="scale"
        name="Scale"
        text={said(scale, granularity.scale)}
        ends={['a small part', 'the largest']}
        min={0}
        max={1}
        step={0.005}
        value={scale}
        disabled={!prompt}
        onInput={(value) => session.drag({ scale: value })}
        onChange={() => session.rest()}
      />
      <Slider
        id="threshold"
        name="Similarity"
        text={said(threshold, granularity.threshold)}
        ends={['more pixels', 'only similar pixels']}
        min={-1}
        max={1}
        step={0.005}
        value={threshold}
        disabled={!prompt}
        onInput={(value) => session.drag({ threshold: value })}
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
  );
}

export function GranularityTools({ session, hasSam }: GranularityProps): JSX.Element {
  const { samClicks } = useStore(session.state);
  return (
    <>
      <SizeSlider session={session} />
      {hasSam && (
        <label class="row" title="SAM and the model answer clicks together: slower, but sharper">
          Refine by SAM
          <select
            value={samClicks}
            onChange={(event) => session.setSamClicks(event.currentTarget.value as SamClicks)}
          >
            <option value="auto">as suits the model</option>
            <option value="on">always</option>
            <option value="off">never</option>
          </select>
        </label>
      )}
      <MoreTools session={session} hasSam={hasSam} />
    </>
  );
}
