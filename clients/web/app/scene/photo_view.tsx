// One view of the scene: its picture, the mask over it, and the clicks on it.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { MissNote } from '../components/miss_note';
import { paintMask } from '../mask/paint';
import type { Mask } from './answer';
import type { Box, Point, Prompt } from './prompt';
import { sizeOf } from './prompt';

export type Source = 'photo' | 'rendering';
export type Tool = 'include' | 'exclude' | 'box';

interface Props {
  view: View;
  /** URL of the photograph, which may be missing. */
  photo: string;
  rendering: string;
  source: Source;
  onSource: (source: Source) => void;
  mask: Mask | undefined;
  /** The prompt, if it is about this view. */
  prompt: Prompt | undefined;
  /** Position of a click that hit nothing in this view. */
  miss: Spot | undefined;
  tool: Tool;
  /** Number of answers shown, for measurements. */
  numAnswers: number;
  onPoint: (point: Point) => void;
  onBox: (box: Box) => void;
}

interface Spot {
  readonly x: number;
  readonly y: number;
}

/** A press that moves less than this, in screen pixels, is a click. */
const clickSlack = 5;
/** Width of the drawing over a view in its own units, so that marks keep their size. */
const drawingWidth = 640;
/** Step of the keyboard's cursor, in units of the drawing. */
const keyStep = 8;

const arrows: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

function boxOf(a: Spot, b: Spot): Box {
  const [x, y] = [Math.min(a.x, b.x), Math.min(a.y, b.y)];
  return { x, y, width: Math.abs(a.x - b.x), height: Math.abs(a.y - b.y) };
}

interface MarksProps {
  prompt: Prompt | undefined;
  drawn: Box | undefined;
  cursor: Spot | undefined;
  /** Units of the drawing for each pixel of the photograph. */
  unit: number;
}

function Marks({ prompt, drawn, cursor: at, unit }: MarksProps): JSX.Element {
  const scaled = ({ x, y }: Spot) => ({ x: x * unit, y: y * unit });
  const points =
    prompt?.kind === 'points'
      ? prompt.points.map((point) => ({ ...scaled(point), negative: point.negative }))
      : [];
  const meant = drawn ?? (prompt?.kind === 'box' ? prompt.box : undefined);
  const box = meant && {
    ...scaled(meant),
    width: meant.width * unit,
    height: meant.height * unit,
  };
  const cursor = at && scaled(at);
  return (
    <>
      {points.map(({ x, y, negative }) => (
        <g key={`${x},${y}`} class={negative ? 'mark negative' : 'mark'}>
          <circle cx={x} cy={y} r="7" />
          <path d={negative ? `M${x - 3.5} ${y}h7` : `M${x - 3.5} ${y}h7M${x} ${y - 3.5}v7`} />
        </g>
      ))}
      {box && <rect class="mark-box" {...box} />}
      {cursor && (
        <path
          class="cursor"
          d={`M${cursor.x - 14} ${cursor.y}h28M${cursor.x} ${cursor.y - 14}v28`}
        />
      )}
    </>
  );
}

export function PhotoView(props: Props): JSX.Element {
  const {
    view,
    photo,
    rendering,
    source,
    onSource,
    mask,
    prompt,
    miss,
    tool,
    numAnswers,
    onPoint,
    onBox,
  } = props;
  const { width, height } = sizeOf(view);
  const unit = drawingWidth / width;
  const canvas = useRef<HTMLCanvasElement>(null);
  const pressed = useRef<(Spot & { screenX: number; screenY: number }) | undefined>(undefined);
  const [drawn, setDrawn] = useState<Box>();
  const [cursor, setCursor] = useState<Spot>();
  const [missing, setMissing] = useState('');
  const hasPhoto = missing !== photo;

  useEffect(() => {
    if (canvas.current) paintMask(canvas.current, mask?.rle);
  }, [mask]);

  const spotOf = (event: PointerEvent): Spot => {
    const edges = (event.currentTarget as Element).getBoundingClientRect();
    const clamp = (value: number, end: number) => Math.min(Math.max(value, 0), end - 0.01);
    return {
      x: clamp(((event.clientX - edges.left) / edges.width) * width, width),
      y: clamp(((event.clientY - edges.top) / edges.height) * height, height),
    };
  };
  const isDrag = ({ clientX, clientY }: PointerEvent) => {
    const from = pressed.current;
    return !!from && Math.hypot(clientX - from.screenX, clientY - from.screenY) > clickSlack;
  };
  const press = (event: PointerEvent) => {
    if (event.button !== 0) return;
    pressed.current = { ...spotOf(event), screenX: event.clientX, screenY: event.clientY };
    // A finger scrolls the page, unless it draws.
    if (event.pointerType !== 'touch' || tool === 'box') {
      (event.currentTarget as Element).setPointerCapture(event.pointerId);
    }
  };
  const move = (event: PointerEvent) => {
    if (pressed.current && isDrag(event)) setDrawn(boxOf(pressed.current, spotOf(event)));
  };
  const release = (event: PointerEvent) => {
    const from = pressed.current;
    if (!from) return;
    const dragged = isDrag(event);
    pressed.current = undefined;
    setDrawn(undefined);
    if (dragged) {
      const box = boxOf(from, spotOf(event));
      if (box.width >= 2 && box.height >= 2) onBox(box);
    } else {
      onPoint({ x: from.x, y: from.y, negative: event.shiftKey || tool === 'exclude' });
    }
  };
  const cancel = () => {
    pressed.current = undefined;
    setDrawn(undefined);
  };
  const key = (event: KeyboardEvent) => {
    const at = cursor ?? { x: width / 2, y: height / 2 };
    const arrow = arrows[event.key];
    if (arrow) {
      const step = (event.shiftKey ? keyStep * 5 : keyStep) / unit;
      const x = Math.min(Math.max(at.x + arrow[0] * step, 0), width - 1);
      const y = Math.min(Math.max(at.y + arrow[1] * step, 0), height - 1);
      setCursor({ x, y });
    } else if (event.key === 'Enter') {
      setCursor(at);
      onPoint({ ...at, negative: event.shiftKey || tool === 'exclude' });
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  };

  return (
    <div class="stage">
      <div
        class={`picture ${tool === 'box' ? 'drawing' : ''}`}
        role="application"
        tabIndex={0}
        aria-label={`View ${view.view}. Arrow keys move a cursor, Enter segments what is under it, Shift and Enter excludes it.`}
        data-view={view.view}
        data-answers={numAnswers}
        data-area={mask?.area ?? 0}
        onPointerDown={press}
        onPointerMove={move}
        onPointerUp={release}
        onPointerCancel={cancel}
        onKeyDown={key}
        onFocus={(event) =>
          (event.currentTarget as Element).matches(':focus-visible') &&
          setCursor(cursor ?? { x: width / 2, y: height / 2 })
        }
        onBlur={() => setCursor(undefined)}
      >
        <img
          src={hasPhoto && source === 'photo' ? photo : rendering}
          width={width}
          height={height}
          alt=""
          draggable={false}
          onError={() => hasPhoto && source === 'photo' && setMissing(photo)}
        />
        <canvas ref={canvas} class="overlay" aria-hidden="true" />
        <svg
          class="overlay"
          viewBox={`0 0 ${drawingWidth} ${height * unit}`}
          aria-hidden="true"
        >
          <Marks prompt={prompt} drawn={drawn} cursor={cursor} unit={unit} />
        </svg>
        {miss && <MissNote x={miss.x / width} y={miss.y / height} />}
      </div>
      {hasPhoto && (
        <button
          type="button"
          class="source"
          aria-label={
            source === 'photo' ? 'Photograph: show the rendering' : 'Rendering: show the photograph'
          }
          onClick={() => onSource(source === 'photo' ? 'rendering' : 'photo')}
        >
          {source === 'photo' ? 'Photograph' : 'Rendering'}
        </button>
      )}
    </div>
  );
}
