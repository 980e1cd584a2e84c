import type { JSX } from 'preact';

interface Props {
  /** Position, as shares of the picture's width and height. */
  x: number;
  y: number;
}

/** A note at a click that hit nothing. */
export function MissNote({ x, y }: Props): JSX.Element {
  const side = x > 0.5 ? 'left' : 'right';
  return (
    <p
      class={`miss ${side}`}
      role="status"
      style={{ left: `${100 * x}%`, top: `${100 * Math.min(Math.max(y, 0.06), 0.94)}%` }}
    >
      Nothing to segment here: click on a thing.
    </p>
  );
}
