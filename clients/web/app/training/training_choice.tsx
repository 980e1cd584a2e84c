// The choice of a training: a quick look or the server's defaults, and the most important numbers.
import type { MessageInitShape } from '@bufbuild/protobuf';
import { clone, create } from '@bufbuild/protobuf';
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { TrainingOptions } from '../../gen/pepeseg/v1/training_options_pb';
import {
  FeatureOptionsSchema,
  ImportOptionsSchema,
  ReconstructOptionsSchema,
  TrainingOptionsSchema,
} from '../../gen/pepeseg/v1/training_options_pb';

type Options = MessageInitShape<typeof TrainingOptionsSchema>;

/** The options of `pepeseg demo`: about 90 s for fifteen small photographs on two cores. */
const quick: Options = {
  reconstruct: {
    numSteps: 2000,
    coarseUntil: 0.5,
    shDegree: 1,
    maxGaussians: 30000n,
    ssimWeight: 0.3,
    meanLearningRate: 1.6e-3,
    meanLearningRateFinal: 1.6e-5,
    shLearningRate: 5e-3,
    densifyGradient: 3e-4,
  },
  features: { numSteps: 1500 },
};

export const defaultTraining: TrainingOptions = create(TrainingOptionsSchema, quick);

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
  const [choice, setChoice] = useState<'quick' | 'full'>('quick');
  const choose = (next: 'quick' | 'full') => {
    setChoice(next);
    onOptions(create(TrainingOptionsSchema, next === 'quick' ? quick : {}));
  };
  const change = (set: (copy: TrainingOptions) => void) => {
    const copy = clone(TrainingOptionsSchema, options);
    set(copy);
    onOptions(copy);
  };
  return (
    <fieldset class="choice">
      <legend>Training</legend>
      <div class="segmented" role="group" aria-label="How much training">
        <button type="button" aria-pressed={choice === 'quick'} onClick={() => choose('quick')}>
          A quick look
        </button>
        <button type="button" aria-pressed={choice === 'full'} onClick={() => choose('full')}>
          Full
        </button>
      </div>
      <p class="quiet">
        {choice === 'quick'
          ? 'Few steps and at most 30,000 Gaussians: a first impression, also without a GPU.'
          : 'The server’s defaults, for a machine with a GPU. Without one it takes hours.'}
      </p>
      <details>
        <summary>Numbers</summary>
        <NumberField
          name="Steps of reconstruction"
          hint="server’s default"
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
          hint="server’s default"
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
