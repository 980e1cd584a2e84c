// The choice of a training: a preset, and the most important numbers.
import { clone, create } from '@bufbuild/protobuf';
import type { JSX } from 'preact';
import type { TrainingOptions } from '../../gen/pepeseg/v1/training_options_pb';
import {
  FeatureOptionsSchema,
  ImportOptionsSchema,
  ReconstructOptionsSchema,
  TrainingOptionsSchema,
} from '../../gen/pepeseg/v1/training_options_pb';
import { presets } from './presets';

function rounded(value: number | undefined): number | undefined {
  return value === undefined ? undefined : Math.round(value);
}

interface Props {
  options: TrainingOptions;
  onOptions: (options: TrainingOptions) => void;
}

interface NumberFieldProps {
  name: string;
  hint: string;
  value: number | undefined;
  min: number;
  max?: number;
  step?: string;
  onValue: (value: number | undefined) => void;
}

function NumberField({ name, hint, value, onValue, ...limits }: NumberFieldProps): JSX.Element {
  return (
    <label class="field">
      <span>{name}</span>
      <input
        type="number"
        inputMode="decimal"
        value={value ?? ''}
        placeholder={hint}
        onInput={({ currentTarget: { value: text } }) =>
          onValue(text === '' ? undefined : Number(text))
        }
        {...limits}
      />
    </label>
  );
}

export function TrainingChoice({ options, onOptions }: Props): JSX.Element {
  const change = (set: (copy: TrainingOptions) => void) => {
    const copy = clone(TrainingOptionsSchema, options);
    set(copy);
    onOptions(copy);
  };
  return (
    <fieldset class="choice">
      <legend>Training</legend>
      <div class="segmented" role="group" aria-label="Preset">
        {presets.map(({ preset, name }) => (
          <button
            key={preset}
            type="button"
            aria-pressed={options.preset === preset}
            onClick={() => change((to) => (to.preset = preset))}
          >
            {name}
          </button>
        ))}
      </div>
      <p class="quiet">{presets.find(({ preset }) => preset === options.preset)?.purpose}</p>
      <details>
        <summary>Steps and size</summary>
        <NumberField
          name="Steps of reconstruction"
          hint="as in the preset"
          min={1}
          value={options.reconstruct?.numSteps}
          onValue={(value) =>
            change(
              (to) =>
                ((to.reconstruct ??= create(ReconstructOptionsSchema)).numSteps = rounded(value)),
            )
          }
        />
        <NumberField
          name="Steps of features"
          hint="as in the preset"
          min={1}
          value={options.features?.numSteps}
          onValue={(value) =>
            change(
              (to) => ((to.features ??= create(FeatureOptionsSchema)).numSteps = rounded(value)),
            )
          }
        />
        <NumberField
          name="Shrink photographs to"
          hint="1 (as they are)"
          min={0.05}
          max={1}
          step="0.05"
          value={options.import?.imageScale}
          onValue={(value) =>
            change((to) => ((to.import ??= create(ImportOptionsSchema)).imageScale = value))
          }
        />
      </details>
    </fieldset>
  );
}
