// What is drawn over a view: clicks, strokes, boxes and the cursor.
import type { JSX } from 'preact';
import type { Box, Prompt, Stroke } from './prompt';

/** Width of the drawing over a view in its own units, so that marks keep their size. */
export const drawingWidth = 640;

export interface Spot {
  readonly x: number;
  readonly y: number;
}

/** How large marks are, whose size on the screen does not change with the zoom. */
export interface MarkScale {
  /** Units of the drawing for each pixel of the photograph. */
  unit: number;
  /** Units of the drawing for each pixel of the screen. */
  mark: number;
}

type DotProps = Spot & { negative: boolean; mark: number };

function Dot({ x, y, negative, mark }: DotProps): JSX.Element {
  return (
    <g
      class={negative ? 'mark negative' : 'mark'}
      transform={`translate(${x} ${y}) scale(${mark})`}
    >
      <circle r="7" />
      <path d={negative ? 'M-3.5 0h7' : 'M-3.5 0h7M0 -3.5v7'} />
    </g>
  );
}

interface StrokeProps extends MarkScale {
  stroke: Stroke;
}

/** A stroke as wide as it is sent, with a line along its middle: dashed for what is not meant. */
function StrokeMark({ stroke, unit, mark }: StrokeProps): JSX.Element {
  const { path, negative, width } = stroke;
  const corners = path.map(({ x, y }) => `${(x * unit).toFixed(2)} ${(y * unit).toFixed(2)}`);
  // A line of no length is a dot, if its ends are round.
  const d = corners.length === 1 ? `M${corners[0]}h0` : `M${corners.join('L')}`;
  return (
    <g class={negative ? 'stroke negative' : 'stroke'}>
      <path class="band" d={d} style={{ strokeWidth: Math.max(width * unit, 4 * mark) }} />
      <path class="middle" d={d} />
    </g>
  );
}

/** An outline that is being drawn, closed. */
function Outline({ stroke: { path }, unit }: Pick<StrokeProps, 'stroke' | 'unit'>): JSX.Element {
  const corners = path.map(({ x, y }) => `${(x * unit).toFixed(2)} ${(y * unit).toFixed(2)}`);
  return <path class="mark-box" d={`M${corners.join('L')}Z`} />;
}

interface Props extends MarkScale {
  prompt: Prompt | undefined;
  /** The box that is being drawn. */
  box: Box | undefined;
  /** The stroke that is being drawn. */
  stroke: Stroke | undefined;
  /** Whether the stroke goes around what is meant. */
  isOutline: boolean;
  cursor: Spot | undefined;
  /** Width of the brush at the cursor, pixels of the photograph; undefined: no brush. */
  brushWidth: number | undefined;
}

export function Marks({ prompt, box: drawn, cursor: at, ...rest }: Props): JSX.Element {
  const { stroke, isOutline, brushWidth, unit, mark } = rest;
  const scaled = ({ x, y }: Spot) => ({ x: x * unit, y: y * unit });
  const points = prompt?.kind === 'points' ? prompt.points : [];
  const strokes = prompt?.kind === 'scribbles' ? prompt.strokes : [];
  const meant = drawn ?? (prompt?.kind === 'box' ? prompt.box : undefined);
  const box = meant && { ...scaled(meant), width: meant.width * unit, height: meant.height * unit };
  const cursor = at && scaled(at);
  return (
    <>
      {stroke && isOutline && <Outline stroke={stroke} unit={unit} />}
      {[...strokes, ...(stroke && !isOutline ? [stroke] : [])].map((each, i) => {
        const [dot] = each.path;
        return each.width === 0 && each.path.length === 1 && dot ? (
          <Dot key={i} {...scaled(dot)} negative={each.negative} mark={mark} />
        ) : (
          <StrokeMark key={i} stroke={each} unit={unit} mark={mark} />
        );
      })}
      {points.map((point) => (
        <Dot
          key={`${point.x},${point.y}`}
          {...scaled(point)}
          negative={point.negative}
          mark={mark}
        />
      ))}
      {box && <rect class="mark-box" {...box} />}
      {cursor && brushWidth !== undefined && (
        <circle
          class="brush"
          cx={cursor.x}
          cy={cursor.y}
          r={Math.max(brushWidth * unit, 4 * mark) / 2}
        />
      )}
      {cursor && brushWidth === undefined && (
        <path
          class="cursor"
          transform={`translate(${cursor.x} ${cursor.y}) scale(${mark})`}
          d="M-14 0h28M0 -14v28"
        />
      )}
    </>
  );
}
