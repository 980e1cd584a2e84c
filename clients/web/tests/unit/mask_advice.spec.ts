import { create } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import { adviceOnDataset, adviceOnModel } from '../../app/screens/mask_advice';
import { DatasetSchema } from '../../gen/pepeseg/v1/dataset_service_pb';
import { ModelSchema } from '../../gen/pepeseg/v1/scene_service_pb';

const forOperators = ['Segments may be poor. Install SAM (make sam, or deploy/sam.sh).'];

function modelWith(quality: number | undefined, masks = 'embedded', advice = forOperators) {
  const metrics: Record<string, number> = quality === undefined ? {} : { mask_quality: quality };
  return create(ModelSchema, { metrics, sources: { masks }, advice });
}

test('advice on a model follows its mask quality', () => {
  expect(adviceOnModel(modelWith(0.41))).toContain('mask quality 0.41 of 1');
  expect(adviceOnModel(modelWith(0.5))).toBeUndefined();
  expect(adviceOnModel(modelWith(0.8))).toBeUndefined();
  expect(adviceOnModel(modelWith(undefined))).toContain('rough');
  expect(adviceOnModel(modelWith(undefined, 'given', []))).toBeUndefined();
  expect(adviceOnModel(modelWith(undefined, 'none'))).toContain('cannot be segmented');
});

test('advice is one sentence without words for operators', () => {
  const all = [
    adviceOnModel(modelWith(0.1)),
    adviceOnModel(modelWith(undefined)),
    adviceOnModel(modelWith(undefined, 'none')),
    adviceOnDataset(create(DatasetSchema, { advice: forOperators })),
  ];
  for (const text of all) {
    expect(text).toMatch(/^[^\n]{20,110}\.$/);
    expect(text).not.toMatch(/sam|deploy|make |command|pepeseg/i);
  }
  expect(adviceOnDataset(create(DatasetSchema))).toBeUndefined();
});
