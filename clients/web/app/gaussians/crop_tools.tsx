// The crop box's faces by sliders, for the keyboard and for exact work.
import type { JSX } from 'preact';
import { useMemo } from 'preact/hooks';
import { Slider } from '../components/slider';
import { boxAround, faces, withFace } from './crop_box';
import type { CropBox, Face } from './crop_box';
import type { GaussianPly } from './gaussian_ply';

const axisNames = ['X', 'Y', 'Z'] as const;
/** Share of the Gaussians between the ends of a slider. */
const widestShare = 0.998;
const numSteps = 500;

interface Props {
  gaussians: GaussianPly;
  crop: CropBox;
  onCrop: (crop: CropBox) => void;
  /** Called when a slider is released. */
  onRest: () => void;
}

function nameOf({ axis, side }: Face): string {
  return `${axisNames[axis]} ${side === 'min' ? 'from' : 'to'}`;
}

export function CropTools({ gaussians, crop, onCrop, onRest }: Props): JSX.Element {
  const widest = useMemo(() => boxAround(gaussians.centers, widestShare), [gaussians]);
  return (
    <details>
      <summary>Faces of the crop box</summary>
      {faces.map((face) => {
        const value = crop[face.side][face.axis];
        const min = Math.min(widest.min[face.axis], value);
        const max = Math.max(widest.max[face.axis], value);
        return (
          <Slider
            key={nameOf(face)}
            id={`crop-${face.axis}-${face.side}`}
            name={nameOf(face)}
            text={value.toPrecision(3)}
            min={min}
            max={max}
            step={(max - min) / numSteps || 1}
            value={value}
            onChange={onRest}
            onInput={(to) => onCrop(withFace(crop, face, to))}
          />
        );
      })}
    </details>
  );
}
