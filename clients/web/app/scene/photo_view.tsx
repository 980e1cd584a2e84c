// One view of the scene: its picture, the mask over it, and the clicks on it.
import type { JSX } from 'preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { MissNote } from '../components/miss_note';
import type { Layer } from '../mask/paint';
import { paintLayers, paintMask } from '../mask/paint';
import { middleOf } from '../mask/rle';
import { useStore } from '../store';
import type { Mask } from './answer';
import type { Brush } from './brush';
import type { ClickPreview } from './hover';
import { HoverMask } from './hover_mask';
import type { SceneEverything } from './everything';
import type { MarkScale, Spot } from './marks';
import { Marks, drawingWidth } from './marks';
import type { Box, Point, Prompt, Stroke } from './prompt';
import { sizeOf } from './prompt';
import type { SegmentNames } from './segment_names';
import { SegmentUnder, SegmentsLayer } from './segments_layer';
import { useShortcuts } from './shortcuts';
import { useDetail } from './use_detail';
import type { Tool } from './use_drawing';
import { drawsLines, isWide, useDrawing } from './use_drawing';
import { useZoom } from './use_zoom';
import { ZoomButtons } from './zoom_buttons';

export type Source = 'photo' | 'rendering';

/** A mask with the name that is written on it, or its number in a list. */
export interface NamedMask extends Layer {
  readonly name: string;
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
  found: readonly NamedMask[];
  /** Masks of named things, drawn while neither everything nor what was found is. */
  things: readonly NamedMask[];
  /** The prompt, if it is about this view. */
  prompt: Prompt | undefined;
  /** Position of a click that hit nothing in this view. */
  miss: Spot | undefined;
  tool: Tool;
  brush: Brush;
  hover: ClickPreview;
  everything: SceneEverything;
  segmentNames: SegmentNames;
  /** Number of answers shown, for measurements. */
  numAnswers: number;
  onPoint: (point: Point) => void;
  onBox: (box: Box) => void;
  onStroke: (stroke: Stroke) => void;
}

const noMasks: readonly NamedMask[] = [];
/** Maximum of the longer side of the unzoomed preview, pixels: it is painted often. */
const previewSide = 1024;

/** Describes what Enter does with a tool. */
function keysOf(tool: Tool): string {
  if (tool === 'lasso') return 'Enter begins and ends an outline around what is meant.';
  if (tool === 'paint' || tool === 'erase') {
    return `Enter begins and ends a stroke that ${tool === 'paint' ? 'adds to' : 'takes from'} the mask.`;
  }
  if (tool === 'brush') {
    return 'Enter begins and ends a stroke over what is meant, Shift and Enter one over what is not.';
  }
  return 'Enter segments what is under it, Shift and Enter excludes it.';
}

/** The names of masks, written on them. */
function Names({
  masks,
  unit,
  mark,
}: { masks: readonly NamedMask[] } & MarkScale): JSX.Element {
  const placed = useMemo(
    () => masks.map(({ name, rle }) => ({ name, at: middleOf(rle) })),
    [masks],
  );
  return (
    <>
      {placed.map(({ name, at: { x, y } }, i) => (
        <g key={i} transform={`translate(${x * unit} ${y * unit}) scale(${mark})`}>
          <text class="found-number">{name}</text>
        </g>
      ))}
    </>
  );
}

export function PhotoView(props: Props): JSX.Element {
  const { view, photoAt, rendering, source, onSource, mask, color, found } = props;
  const { prompt, miss, tool, hover, everything, numAnswers } = props;
  const { isOn: showsAll } = useStore(everything.state);
  const { width, height } = sizeOf(view);
  const unit = drawingWidth / width;
  const canvas = useRef<HTMLCanvasElement>(null);
  const thingsCanvas = useRef<HTMLCanvasElement>(null);
  const [missing, setMissing] = useState('');
  /** URL of the newest picture that was loaded, or could not be. */
  const [loaded, setLoaded] = useState('');
  const photo = { width, height };
  const zooming = useZoom(photo, view.view, () => drawing.interrupt());
  const { zoom, placed } = zooming;
  const drawing = useDrawing(
    {
      ...props,
      view: view.view,
      photo,
      watch: showsAll ? everything.pointer : hover,
      onCursor: showsAll ? (spot) => everything.pointer.move(view.view, spot) : undefined,
    },
    zooming,
  );
  const { box, stroke, cursor, mouse, brushWidth } = drawing;
  const detail = useDetail(view.view, photo, zoom.scale);
  const photoSrc = photoAt(detail.photo);
  const hasPhoto = missing !== photoSrc;
  const shown = hasPhoto && source === 'photo' ? photoSrc : rendering;
  useEffect(() => {
    if (!canvas.current) return;
    if (mask) paintMask(canvas.current, mask.rle, color, detail.mask);
    else paintLayers(canvas.current, found, detail.mask);
  }, [mask, color, found, detail]);
  const shownThings = showsAll || found.length > 0 ? noMasks : props.things;
  useEffect(() => {
    if (thingsCanvas.current) paintLayers(thingsCanvas.current, shownThings, detail.mask);
  }, [shownThings, detail]);
  const mark = drawingWidth / Math.max(placed.width, 1);
  const zoomIn = () => zooming.step(1, cursor);
  useShortcuts({
    '+': zoomIn,
    '=': zoomIn, // the key of the plus sign without Shift
    '-': () => zooming.step(-1, cursor),
    '0': zooming.fit,
  });
  const classes = ['picture'];
  if (tool === 'box' || drawsLines(tool)) classes.push('drawing');
  if (isWide(tool)) classes.push('brushing');
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
        aria-label={`View ${view.view}. Arrow keys move a cursor, ${keysOf(tool)}`}
        data-view={view.view}
        data-answers={numAnswers}
        data-zoom={zoom.scale.toFixed(2)}
        data-area={mask?.area ?? 0}
        data-found={mask ? 0 : found.length}
        data-things={shownThings.length}
        {...drawing.handlers}
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
            if (shown === photoSrc) setMissing(photoSrc);
          }}
        />
        <SegmentsLayer everything={everything} view={view.view} isFaint={mask !== undefined} />
        <canvas
          ref={thingsCanvas}
          class={`overlay things-layer ${mask ? 'faint' : ''}`}
          aria-hidden="true"
        />
        <canvas ref={canvas} class="overlay mask" aria-hidden="true" />
        <HoverMask
          hover={hover}
          view={view.view}
          maxSide={Math.min(detail.mask, Math.ceil(zoom.scale) * previewSide)}
        />
        <svg
          class="overlay"
          viewBox={`0 0 ${drawingWidth} ${height * unit}`}
          aria-hidden="true"
        >
          <Names masks={shownThings} unit={unit} mark={mark} />
          {!mask && <Names masks={found} unit={unit} mark={mark} />}
          <Marks
            prompt={prompt}
            box={box}
            stroke={stroke}
            isOutline={tool === 'lasso'}
            cursor={cursor ?? mouse}
            brushWidth={brushWidth}
            unit={unit}
            mark={mark}
          />
        </svg>
        {miss && <MissNote x={miss.x / width} y={miss.y / height} />}
      </div>
      <SegmentUnder everything={everything} names={props.segmentNames} />
      {loaded !== shown && (
        <p class="pane-note late" role="status">
          Loading the {shown === photoSrc ? 'photograph' : 'rendering'} …
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
