// One view of the scene: its picture, the mask over it, and the clicks on it.
import type { JSX } from 'preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { MissNote } from '../components/miss_note';
import type { Layer } from '../mask/paint';
import { paintLayers, paintMask } from '../mask/paint';
import { middleOf } from '../mask/rle';
import type { Mask } from './answer';
import type { Brush } from './brush';
import { continued, strokeWidth } from './brush';
import type { MarkScale, Spot } from './marks';
import { Marks, drawingWidth } from './marks';
import type { Box, Point, Prompt, Stroke } from './prompt';
import { sizeOf } from './prompt';
import { useShortcuts } from './shortcuts';
import { useDetail } from './use_detail';
import { useZoom } from './use_zoom';
import { ZoomButtons } from './zoom_buttons';

export type Source = 'photo' | 'rendering';
export type Tool = 'include' | 'exclude' | 'box' | 'brush';

/** The mask of a found thing, with its number and colour in the list. */
export interface FoundMask extends Layer {
  readonly number: number;
}

interface Props {
  view: View;
  /** Returns the URL of the photograph, shrunk to a longer side; it may be missing. */
  photoAt: (maxSide: number) => string;
  rendering: string;
  source: Source;
  onSource: (source: Source) => void;
  mask: Mask | undefined;
  /** Colour of the mask; absent: the accent's. */
  color: Layer['color'] | undefined;
  /** Masks of what was found, drawn while there is no other. */
  found: readonly FoundMask[];
  /** The prompt, if it is about this view. */
  prompt: Prompt | undefined;
  /** Position of a click that hit nothing in this view. */
  miss: Spot | undefined;
  tool: Tool;
  brush: Brush;
  /** Number of answers shown, for measurements. */
  numAnswers: number;
  onPoint: (point: Point) => void;
  onBox: (box: Box) => void;
  onStroke: (stroke: Stroke) => void;
}

/** A press that moves less than this, in screen pixels, is a click. */
const clickSlack = 5;
/** Step of the keyboard's cursor, in units of the drawing. */
const keyStep = 8;

const arrows: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

const enterClicks = 'Enter segments what is under it, Shift and Enter excludes it.';
const enterDraws =
  'Enter begins and ends a stroke over what is meant, Shift and Enter one over what is not.';

function boxOf(a: Spot, b: Spot): Box {
  const [x, y] = [Math.min(a.x, b.x), Math.min(a.y, b.y)];
  return { x, y, width: Math.abs(a.x - b.x), height: Math.abs(a.y - b.y) };
}

/** The numbers of found things on their masks. */
function Numbers({
  found,
  unit,
  mark,
}: { found: readonly FoundMask[] } & MarkScale): JSX.Element {
  const placed = useMemo(
    () => found.map(({ number, rle }) => ({ number, at: middleOf(rle) })),
    [found],
  );
  return (
    <>
      {placed.map(({ number, at: { x, y } }) => (
        <g key={number} transform={`translate(${x * unit} ${y * unit}) scale(${mark})`}>
          <text class="found-number">{number}</text>
        </g>
      ))}
    </>
  );
}

export function PhotoView(props: Props): JSX.Element {
  const {
    view,
    photoAt,
    rendering,
    source,
    onSource,
    mask,
    color,
    found,
    prompt,
    miss,
    tool,
    brush,
    numAnswers,
    onPoint,
    onBox,
    onStroke,
  } = props;
  const { width, height } = sizeOf(view);
  const unit = drawingWidth / width;
  const canvas = useRef<HTMLCanvasElement>(null);
  const pressed = useRef<(Spot & { screenX: number; screenY: number }) | undefined>(undefined);
  const [box, setBox] = useState<Box>();
  const [stroke, setStroke] = useState<Stroke>();
  const [cursor, setCursor] = useState<Spot>();
  /** Position of the mouse, where the brush shows its width. */
  const [hover, setHover] = useState<Spot>();
  const [missing, setMissing] = useState('');
  /** URL of the newest picture that was loaded, or could not be. */
  const [loaded, setLoaded] = useState('');

  const isDrag = ({ clientX, clientY }: PointerEvent) => {
    const from = pressed.current;
    return !!from && Math.hypot(clientX - from.screenX, clientY - from.screenY) > clickSlack;
  };
  const isBrush = tool === 'brush';
  const brushWidth = strokeWidth(brush, width);
  const newStroke = ({ x, y }: Spot, shift: boolean): Stroke => {
    return { path: [{ x, y }], negative: shift !== brush.negative, width: brushWidth };
  };
  const negativePoint = (shift: boolean) => shift || tool === 'exclude';
  const drop = () => {
    pressed.current = undefined;
    setBox(undefined);
    setStroke(undefined);
  };
  const zooming = useZoom({ width, height }, view.view, drop);
  const { zoom, placed, spotOf } = zooming;
  const detail = useDetail(view.view, { width, height }, zoom.scale);
  const photo = photoAt(detail.photo);
  const hasPhoto = missing !== photo;
  const shown = hasPhoto && source === 'photo' ? photo : rendering;
  useEffect(() => {
    if (!canvas.current) return;
    if (mask) paintMask(canvas.current, mask.rle, color, detail.mask);
    else paintLayers(canvas.current, found, detail.mask);
  }, [mask, color, found, detail]);
  const mark = drawingWidth / Math.max(placed.width, 1);
  const finish = () => {
    if (stroke) onStroke(stroke);
    drop();
  };

  const press = (event: PointerEvent) => {
    if (event.button !== 0) return;
    pressed.current = { ...spotOf(event), screenX: event.clientX, screenY: event.clientY };
    if (isBrush) setStroke(newStroke(spotOf(event), event.shiftKey));
    // A finger scrolls the page, unless it draws.
    if (event.pointerType !== 'touch' || tool === 'box' || isBrush) {
      (event.currentTarget as Element).setPointerCapture(event.pointerId);
    }
  };
  const move = (event: PointerEvent) => {
    const spot = spotOf(event);
    if (isBrush && event.pointerType !== 'touch') setHover(spot);
    if (!pressed.current) return;
    if (isBrush) setStroke((begun) => begun && continued(begun, spot, width / zoom.scale));
    else if (isDrag(event)) setBox(boxOf(pressed.current, spot));
  };
  const release = (event: PointerEvent) => {
    const from = pressed.current;
    if (!from) return;
    if (isBrush) return finish();
    const dragged = isDrag(event);
    drop();
    if (dragged) {
      const drawn = boxOf(from, spotOf(event));
      if (drawn.width >= 2 && drawn.height >= 2) onBox(drawn);
    } else {
      onPoint({ x: from.x, y: from.y, negative: negativePoint(event.shiftKey) });
    }
  };
  const enter = (at: Spot, shift: boolean) => {
    setCursor(at);
    if (!isBrush) onPoint({ ...at, negative: negativePoint(shift) });
    else if (stroke) finish();
    else setStroke(newStroke(at, shift));
  };
  const key = (event: KeyboardEvent) => {
    const at = cursor ?? { x: width / 2, y: height / 2 };
    const arrow = arrows[event.key];
    if (arrow) {
      const step = (event.shiftKey ? keyStep * 5 : keyStep) / unit / zoom.scale;
      const x = Math.min(Math.max(at.x + arrow[0] * step, 0), width - 1);
      const y = Math.min(Math.max(at.y + arrow[1] * step, 0), height - 1);
      setCursor({ x, y });
      zooming.reveal({ x, y });
      setStroke((begun) => begun && continued(begun, { x, y }, width / zoom.scale));
    } else if (event.key === 'Enter') {
      enter(at, event.shiftKey);
    } else if (event.key === 'Escape' && stroke) {
      drop();
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
  };
  useEffect(drop, [view.view, tool]);
  const zoomIn = () => zooming.step(1, cursor);
  useShortcuts({
    '+': zoomIn,
    '=': zoomIn, // the key of the plus sign without Shift
    '-': () => zooming.step(-1, cursor),
    '0': zooming.fit,
  });
  const classes = ['picture'];
  if (tool === 'box' || isBrush) classes.push('drawing');
  if (isBrush) classes.push('brushing');
  if (zooming.isPanning) classes.push('panning');
  if (zoom.scale > 4) classes.push('pixelated');

  return (
    <div class="stage" ref={zooming.stage} {...zooming.handlers}>
      <div
        class={classes.join(' ')}
        style={{
          left: `${placed.left}px`,
          top: `${placed.top}px`,
          width: `${placed.width}px`,
          height: `${placed.height}px`,
        }}
        role="application"
        tabIndex={0}
        aria-label={`View ${view.view}. Arrow keys move a cursor, ${isBrush ? enterDraws : enterClicks}`}
        data-view={view.view}
        data-answers={numAnswers}
        data-zoom={zoom.scale.toFixed(2)}
        data-area={mask?.area ?? 0}
        data-found={mask ? 0 : found.length}
        onPointerDown={press}
        onPointerMove={move}
        onPointerUp={release}
        onPointerCancel={drop}
        onPointerLeave={() => setHover(undefined)}
        onKeyDown={key}
        onFocus={(event) =>
          (event.currentTarget as Element).matches(':focus-visible') &&
          setCursor(cursor ?? { x: width / 2, y: height / 2 })
        }
        onBlur={() => {
          setCursor(undefined);
          drop();
        }}
      >
        <img
          src={shown}
          width={width}
          height={height}
          alt=""
          draggable={false}
          onLoad={() => setLoaded(shown)}
          onError={() => {
            setLoaded(shown);
            if (shown === photo) setMissing(photo);
          }}
        />
        <canvas ref={canvas} class="overlay" aria-hidden="true" />
        <svg
          class="overlay"
          viewBox={`0 0 ${drawingWidth} ${height * unit}`}
          aria-hidden="true"
        >
          {!mask && <Numbers found={found} unit={unit} mark={mark} />}
          <Marks
            prompt={prompt}
            box={box}
            stroke={stroke}
            cursor={cursor ?? (isBrush ? hover : undefined)}
            brushWidth={isBrush ? brushWidth : undefined}
            unit={unit}
            mark={mark}
          />
        </svg>
        {miss && <MissNote x={miss.x / width} y={miss.y / height} />}
      </div>
      {loaded !== shown && (
        <p class="pane-note late" role="status">
          Loading the {shown === photo ? 'photograph' : 'rendering'} …
        </p>
      )}
      {stroke && cursor && (
        <p class="pane-note" role="status">
          Arrow keys draw. Enter ends the stroke, Esc drops it.
        </p>
      )}
      <ZoomButtons
        scale={zoom.scale}
        onStep={(steps) => zooming.step(steps, cursor)}
        onFit={zooming.fit}
      />
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
