import type { JSX } from 'preact';
import { Icon } from '../components/icons';
import { maxScale } from './photo_frame';

interface Props {
  scale: number;
  /** Zooms in (1) or out (-1). */
  onStep: (steps: number) => void;
  onFit: () => void;
}

/** Buttons over the photograph: zoom out, all of it, zoom in. */
export function ZoomButtons({ scale, onStep, onFit }: Props): JSX.Element {
  return (
    <div class="pane-buttons right" role="group" aria-label="Zoom">
      <button
        type="button"
        aria-label="Zoom out"
        title="Zoom out (-)"
        disabled={scale <= 1}
        onClick={() => onStep(-1)}
      >
        <Icon name="minus" />
      </button>
      <button
        type="button"
        aria-label={`Fit: ${scale.toFixed(1)} times`}
        title="Show all of the photograph (0)"
        disabled={scale <= 1}
        onClick={onFit}
      >
        {scale > 1 ? `${scale.toFixed(1)}×` : 'Fit'}
      </button>
      <button
        type="button"
        aria-label="Zoom in"
        title="Zoom in (+)"
        disabled={scale >= maxScale}
        onClick={() => onStep(1)}
      >
        <Icon name="plus" />
      </button>
    </div>
  );
}
