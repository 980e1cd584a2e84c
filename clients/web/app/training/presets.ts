// The presets of the contract (TrainingPreset), with its names.
import { create } from '@bufbuild/protobuf';
import type { TrainingOptions } from '../../gen/pepeseg/v1/training_options_pb';
import { TrainingOptionsSchema, TrainingPreset } from '../../gen/pepeseg/v1/training_options_pb';

export interface PresetChoice {
  readonly preset: TrainingPreset;
  readonly name: string;
  /** What the preset is for, in a sentence or two. */
  readonly purpose: string;
}

type Preset = Exclude<TrainingPreset, TrainingPreset.UNSPECIFIED>;

const purposes: Record<Preset, string> = {
  [TrainingPreset.PREVIEW]: 'The quickest: something to click on as soon as possible.',
  [TrainingPreset.STANDARD]:
    'The server’s defaults, for a machine with a GPU. Without one it takes hours.',
  [TrainingPreset.BEST]: 'The best model, in about twice the time of Standard.',
  [TrainingPreset.PAPER]:
    'The recipe of the paper PePESeg3D as printed, to compare with. It needs much memory.',
};

/** Returns the contract's name as the app writes it: PREVIEW is "Preview". */
function nameOf(preset: TrainingPreset): string {
  const name = TrainingPreset[preset] ?? '';
  return name.charAt(0) + name.slice(1).toLowerCase();
}

/** All presets, the quickest first. */
export const presets: readonly PresetChoice[] = Object.entries(purposes).map(([key, purpose]) => {
  const preset = Number(key) as TrainingPreset;
  return { preset, name: nameOf(preset), purpose };
});

/** The options of a training that a person has not changed: the quickest. */
export const defaultTraining: TrainingOptions = create(TrainingOptionsSchema, {
  preset: TrainingPreset.PREVIEW,
});
