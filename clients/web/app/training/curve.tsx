// A live curve: one series over the steps of a stage.
import type { JSX } from 'preact';
import type { Sample } from './training_watch';

interface Props {
  title: string;
  unit?: string;
  samples: readonly Sample[];
  /** Number of steps of the stage, which is the width. */
  numSteps: number;
  digits?: number;
}

const width = 320;
const height = 120;
/** Maximum number of points: more points than pixels would show nothing more. */
const maxPoints = 400;

function thinned(samples: readonly Sample[]): readonly Sample[] {
  if (samples.length <= maxPoints) return samples;
  const every = Math.ceil(samples.length / maxPoints);
  return samples.filter((_, i) => i % every === 0 || i === samples.length - 1);
}

export function Curve({ title, unit = '', samples, numSteps, digits = 2 }: Props): JSX.Element {
  const values = samples.map(({ value }) => value).filter(Number.isFinite);
  const low = Math.min(...values);
  const high = Math.max(...values);
  const text = (value: number) =>
    value.toLocaleString('en', { minimumFractionDigits: digits, maximumFractionDigits: digits });
  const last = samples.at(-1);
  const end = Math.max(numSteps, last?.step ?? 1);
  const x = (step: number) => (step / end) * width;
  const y = (value: number) => height - 4 - ((value - low) / (high - low || 1)) * (height - 8);
  const line = thinned(samples)
    .map(
      ({ step, value }, i) => `${i === 0 ? 'M' : 'L'}${x(step).toFixed(1)} ${y(value).toFixed(1)}`,
    )
    .join('');
  return (
    <figure class="curve" data-samples={samples.length} data-first={samples[0]?.step}>
      <figcaption>
        <span>{title}</span>
        <strong>{last ? `${text(last.value)}${unit && ` ${unit}`}` : '–'}</strong>
      </figcaption>
      <svg
        viewBox={`0 0 ${width} ${height}`}
        preserveAspectRatio="none"
        role="img"
        aria-label={`${title} over the steps`}
      >
        {[0.25, 0.5, 0.75].map((share) => (
          <path key={share} class="grid" d={`M0 ${height * share}H${width}`} />
        ))}
        {line && <path class="line" d={line} />}
      </svg>
      <div class="ends" aria-hidden="true">
        <span>{values.length > 1 ? `${text(low)} – ${text(high)}` : ''}</span>
        <span>{numSteps > 0 ? `${numSteps.toLocaleString('en')} steps` : ''}</span>
      </div>
    </figure>
  );
}
