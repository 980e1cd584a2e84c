import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { paintMask } from '../mask/paint';
import type { Mask } from './answer';

/** Longer side of the mask on a thumbnail, pixels: twice its size on the screen. */
export const thumbnailSide = 256;

interface ThumbProps {
  view: View;
  /** URL of the photograph, which may be missing. */
  photo: string;
  rendering: string;
  mask: Mask | undefined;
  current: boolean;
  onPick: () => void;
}

function Thumb({ view, photo, rendering, mask, current, onPick }: ThumbProps): JSX.Element {
  const [missing, setMissing] = useState('');
  const canvas = useRef<HTMLCanvasElement>(null);
  const button = useRef<HTMLButtonElement>(null);
  useEffect(() => {
    if (canvas.current) paintMask(canvas.current, mask?.rle, thumbnailSide);
  }, [mask]);
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
    </button>
  );
}

interface Props {
  views: readonly View[];
  current: string;
  masks: ReadonlyMap<string, Mask> | undefined;
  photoOf: (view: View) => string;
  renderingOf: (view: View) => string;
  onPick: (view: View) => void;
}

/** All views of the scene, each with its mask. */
export function Filmstrip(props: Props): JSX.Element {
  const { views, current, masks, photoOf, renderingOf, onPick } = props;
  return (
    <nav class="filmstrip" aria-label="Views of the scene">
      {views.map((view) => (
        <Thumb
          key={view.view}
          view={view}
          photo={photoOf(view)}
          rendering={renderingOf(view)}
          mask={masks?.get(view.view)}
          current={view.view === current}
          onPick={() => onPick(view)}
        />
      ))}
    </nav>
  );
}
