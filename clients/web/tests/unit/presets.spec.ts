import { expect, test } from '@playwright/test';
import { defaultTraining, presets } from '../../app/training/presets';
import { TrainingPreset } from '../../gen/pepeseg/v1/training_options_pb';

test('the presets are those of the contract, with its names', () => {
  const known = Object.values(TrainingPreset).filter((value) => typeof value === 'number');
  expect(presets.map(({ preset }) => preset)).toEqual(
    known.filter((value) => value !== TrainingPreset.UNSPECIFIED),
  );
  expect(presets.map(({ name }) => name)).toEqual(['Preview', 'Standard', 'Best', 'Paper']);
});

test('the quickest training is the preset Preview, without other options', () => {
  const { preset, reconstruct, features } = defaultTraining;
  expect([preset, reconstruct, features]).toEqual([TrainingPreset.PREVIEW, undefined, undefined]);
  expect(presets[0]).toMatchObject({ preset: TrainingPreset.PREVIEW });
  expect(presets[0]?.purpose).toContain('quickest');
});
