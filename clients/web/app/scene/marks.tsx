// What is drawn over a view: clicks, strokes, boxes and the cursor.
import type { JSX } from 'preact';
import type { Box, Prompt, Stroke } from './prompt';

/** Width of the drawing over a view in its own units, so that marks keep their size. */
export const drawingWidth = 640;

export interface Spot {
  readonly x: number;
  readonly y: number;
}

function Dot({ x, y, negative }: Spot & { negative: boolean }): JSX.Element {
  return (
    <g class={negative ? 'mark negative' : 'mark'}>
      <circle cx={x} cy={y} r="7" />
      <path d={negative ? `M${x - 3.5} ${y}h7` : `M${x - 3.5} ${y}h7M${x} ${y - 3.5}v7`} />
    </g>
  );
}

interface StrokeProps {
  stroke: Stroke;
  unit: number;
}

/** A stroke as wide as it is sent, with a line along its middle: dashed for what is not meant. */
function StrokeMark({ stroke: { path, negative, width }, unit }: StrokeProps): JSX.Element {
  const corners = path.map(({ x, y }) => `${(x * unit).toFixed(1)} ${(y * unit).toFixed(1)}`);
  // A line of no length is a dot, if its ends are round.
  const d = corners.length === 1 ? `M${corners[0]}h0` : `M${corners.join('L')}`;
  return (
    <g class={negative ? 'stroke negative' : 'stroke'}>
      <path class="band" d={d} style={{ strokeWidth: Math.max(width * unit, 4) }} />
      <path class="middle" d={d} />
    </g>
  );
}

interface Props {
  prompt: Prompt | undefined;
  /** The box that is being drawn. */
  box: Box | undefined;
  /** The stroke that is being drawn. */
  stroke: Stroke | undefined;
  cursor: Spot | undefined;
  /** Width of the brush at the cursor, pixels of the photograph; undefined: no brush. */
  brushWidth: number | undefined;
  /** Units of the drawing for each pixel of the photograph. */
  unit: number;
}

export function Marks({ prompt, box: drawn, stroke, cursor: at, ...rest }: Props): JSX.Element {
  const { brushWidth, unit } = rest;
  const scaled = ({ x, y }: Spot) => ({ x: x * unit, y: y * unit });
  const points = prompt?.kind === 'points' ? prompt.points : [];
  const strokes = prompt?.kind === 'scribbles' ? prompt.strokes : [];
  const meant = drawn ?? (prompt?.kind === 'box' ? prompt.box : undefined);
  const box = meant && { ...scaled(meant), width: meant.width * unit, height: meant.height * unit };
  const cursor = at && scaled(at);
  return (
    <>
      {[...strokes, ...(stroke ? [stroke] : [])].map((each, i) => {
        const [dot] = each.path;
        return each.width === 0 && each.path.length === 1 && dot ? (
          <Dot key={i} {...scaled(dot)} negative={each.negative} />
        ) : (
          <StrokeMark key={i} stroke={each} unit={unit} />
        );
      })}
      {points.map((point) => (
        <Dot key={`${point.x},${point.y}`} {...scaled(point)} negative={point.negative} />
      ))}
      {box && <rect class="mark-box" {...box} />}
      {cursor && brushWidth !== undefined && (
        <circle class="brush" cx={cursor.x} cy={cursor.y} r={Math.max(brushWidth * unit, 4) / 2} />
      )}
      {cursor && brushWidth === undefined && (
        <path
          class="cursor"
          d={`M${cursor.x - 14} ${cursor.y}h28M${cursor.x} ${cursor.y - 14}v28`}
        />
      )}
    </>
  );
}
