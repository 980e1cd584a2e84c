import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { paintMask } from '../mask/paint';
import type { Mask } from './answer';
import type { Appearance, Rgb } from './found_things';
import { sizeOf } from './prompt';

/** Longer side of the mask on a thumbnail, pixels: twice its size on the screen. */
export const thumbnailSide = 256;

/** A box around a found thing in a view, in its colour. */
export interface FoundBox extends Appearance {
  readonly color: Rgb;
}

interface ThumbProps {
  view: View;
  /** URL of the photograph, which may be missing. */
  photo: string;
  rendering: string;
  mask: Mask | undefined;
  color: Rgb | undefined;
  found: readonly FoundBox[];
  current: boolean;
  onPick: () => void;
}

function Thumb(props: ThumbProps): JSX.Element {
  const { view, photo, rendering, mask, color, found, current, onPick } = props;
  const [missing, setMissing] = useState('');
  const canvas = useRef<HTMLCanvasElement>(null);
  const button = useRef<HTMLButtonElement>(null);
  const { width, height } = sizeOf(view);
  useEffect(() => {
    if (canvas.current) paintMask(canvas.current, mask?.rle, color, thumbnailSide);
  }, [mask, color]);
  useEffect(() => {
    if (current) button.current?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
  }, [current]);
  return (
    <button
      ref={button}
      type="button"
      class="thumb"
      aria-current={current}
      aria-label={`View ${view.view}${mask && mask.area > 0 ? ', segment visible' : ''}`}
      title={view.view}
      data-area={mask?.area ?? 0}
      onClick={onPick}
    >
      <img
        src={missing === photo ? rendering : photo}
        alt=""
        loading="lazy"
        draggable={false}
        onError={() => setMissing(photo)}
      />
      <canvas ref={canvas} class="overlay" aria-hidden="true" />
      {found.length > 0 && (
        <svg class="overlay" viewBox={`0 0 ${width} ${height}`} aria-hidden="true">
          {found.map(({ color, x, y, width: wide, height: high }, i) => (
            <rect
              key={i}
              class="found-box"
              {...{ x, y, width: wide, height: high }}
              stroke={`rgb(${color.join(' ')})`}
            />
          ))}
        </svg>
      )}
    </button>
  );
}

interface Props {
  views: readonly View[];
  current: string;
  masks: ReadonlyMap<string, Mask> | undefined;
  /** Colour of the masks; absent: the accent's. */
  color: Rgb | undefined;
  /** Boxes around what was found. */
  found: readonly FoundBox[];
  photoOf: (view: View) => string;
  renderingOf: (view: View) => string;
  onPick: (view: View) => void;
}

/** Turns the strip by a wheel that has one direction. */
function scrollSideways(event: WheelEvent): void {
  if (event.deltaX !== 0) return;
  const strip = event.currentTarget as HTMLElement;
  if (strip.scrollWidth <= strip.clientWidth) return;
  event.preventDefault();
  strip.scrollLeft += event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * 40;
}

/** All views of the scene in one row, each with its mask. */
export function Filmstrip(props: Props): JSX.Element {
  const { views, current, masks, color, found, photoOf, renderingOf, onPick } = props;
  return (
    <nav class="filmstrip" aria-label="Views of the scene" onWheel={scrollSideways}>
      {views.map((view) => (
        <Thumb
          key={view.view}
          view={view}
          photo={photoOf(view)}
          rendering={renderingOf(view)}
          mask={masks?.get(view.view)}
          color={color}
          found={found.filter((box) => box.view === view.view)}
          current={view.view === current}
          onPick={() => onPick(view)}
        />
      ))}
    </nav>
  );
}
