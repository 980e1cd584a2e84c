import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { paintMask } from '../mask/paint';
import type { Mask } from './answer';

interface ThumbProps {
  view: View;
  picture: string;
  mask: Mask | undefined;
  current: boolean;
  onPick: () => void;
}

function Thumb({ view, picture, mask, current, onPick }: ThumbProps): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const button = useRef<HTMLButtonElement>(null);
  useEffect(() => {
    if (canvas.current) paintMask(canvas.current, mask?.rle);
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
      data-area={mask?.area ?? 0}
      onClick={onPick}
    >
      <img src={picture} alt="" loading="lazy" draggable={false} />
      <canvas ref={canvas} class="overlay" aria-hidden="true" />
    </button>
  );
}

interface Props {
  views: readonly View[];
  current: string;
  masks: ReadonlyMap<string, Mask> | undefined;
  pictureOf: (view: View) => string;
  onPick: (view: View) => void;
}

/** All views of the scene, each with the mask over it. */
export function Filmstrip({ views, current, masks, pictureOf, onPick }: Props): JSX.Element {
  return (
    <nav class="filmstrip" aria-label="Views of the scene">
      {views.map((view) => (
        <Thumb
          key={view.view}
          view={view}
          picture={pictureOf(view)}
          mask={masks?.get(view.view)}
          current={view.view === current}
          onPick={() => onPick(view)}
        />
      ))}
    </nav>
  );
}
