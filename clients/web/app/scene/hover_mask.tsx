// The preview of a click, drawn over a view, and its switch in the panel.
import type { JSX } from 'preact';
import { useLayoutEffect, useRef } from 'preact/hooks';
import { paintPreview } from '../mask/paint_preview';
import { useStore } from '../store';
import type { ClickPreview } from './hover';
import type { SceneSession } from './session';

interface MaskProps {
  hover: ClickPreview;
  view: string;
  /** Maximum of the longer side of what is drawn, pixels. */
  maxSide: number;
}

export function HoverMask({ hover, view, maxSide }: MaskProps): JSX.Element {
  const { mask, at, isLate } = useStore(hover.state);
  const canvas = useRef<HTMLCanvasElement>(null);
  const shown = mask?.view === view ? mask : undefined;
  // Before the next frame, since somebody watches it follow the pointer.
  useLayoutEffect(() => {
    if (canvas.current) paintPreview(canvas.current, shown?.rle, maxSide);
  }, [shown, maxSide]);
  return (
    <canvas
      ref={canvas}
      class="overlay click-preview"
      aria-hidden="true"
      data-at={at}
      data-late={isLate}
      data-area={shown?.area ?? 0}
    />
  );
}

/** Turns the preview on and off, and says who answers the click itself. */
export function HoverSwitch({ session }: { session: SceneSession }): JSX.Element {
  const { isOn } = useStore(session.hover.state);
  const { samClicks } = useStore(session.state);
  return (
    <div class="hover-switch">
      <label class="check" title="Shows what a click would give, without a click (U)">
        <input
          type="checkbox"
          checked={isOn}
          onChange={(event) => session.hover.turn(event.currentTarget.checked)}
        />
        Preview under the pointer
      </label>
      {isOn && samClicks !== 'off' && (
        <p class="quiet">It is the model’s mask. After the click SAM may change it.</p>
      )}
    </div>
  );
}
