import { create } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import { JobEventSchema, JobStage } from '../../gen/pepeseg/v1/job_service_pb';
import { ViewSchema } from '../../gen/pepeseg/v1/scene_service_pb';
import { cocoJson } from '../../app/mask/coco';
import { segmentRequest, sizeOf } from '../../app/scene/prompt';

test('pixels are those of the photograph where its size is known', () => {
  const camera = { width: 320, height: 240 };
  expect(sizeOf(create(ViewSchema, { camera }))).toEqual({ width: 320, height: 240 });
  const photograph = { photographWidth: 640, photographHeight: 480 };
  expect(sizeOf(create(ViewSchema, { camera, ...photograph }))).toEqual({
    width: 640,
    height: 480,
  });
});

test('the server chooses what is not given', () => {
  const prompt = {
    kind: 'points',
    place: { view: 'a.jpg' },
    points: [{ x: 1, y: 2, negative: false }],
  } as const;
  const open = segmentRequest('m', prompt, {});
  expect(open.granularity?.scale.case).toBeUndefined();
  expect(open.granularity?.threshold).toBeUndefined();
  const fixed = segmentRequest('m', prompt, { scale: 0, threshold: 0 }, ['b.jpg']);
  expect(fixed.granularity?.scale).toEqual({ case: 'scaleQuantile', value: 0 });
  expect(fixed.granularity?.threshold).toBe(0);
  expect(fixed.targets?.views).toEqual(['b.jpg']);
});

test('COCO: ids from 1, no empty masks, sizes height first', () => {
  const rle = { width: 4, height: 3, counts: 'x' };
  const masks = [
    { view: 'b.jpg', rle, area: 5, box: [0, 1, 2, 3], score: 0.9 },
    { view: 'a.jpg', rle, area: 0, box: [0, 0, 0, 0], score: 0 },
  ];
  const views = [
    { view: 'a.jpg', width: 4, height: 3 },
    { view: 'b.jpg', width: 4, height: 3 },
  ];
  expect(cocoJson('shelf', views, [{ id: 'cup-2', category: 'cup', masks }])).toMatchObject({
    images: [
      { id: 1, file_name: 'a.jpg' },
      { id: 2, file_name: 'b.jpg' },
    ],
    categories: [{ id: 1, name: 'cup' }],
    annotations: [
      {
        id: 1,
        image_id: 2,
        category_id: 1,
        bbox: [0, 1, 2, 3],
        segmentation: { size: [3, 4], counts: 'x' },
      },
    ],
  });
});

test('events of a training make its curves; a step done again takes the place of what followed', async () => {
  // The module listens to the page's network events.
  Object.assign(globalThis, { window: new EventTarget() });
  const { after, noTraining } = await import('../../app/training/training_watch');
  const progress = (sequence: bigint, step: bigint, loss: number) =>
    create(JobEventSchema, {
      sequence,
      event: { case: 'progress', value: { stage: JobStage.RECONSTRUCT, step, loss, numGaussians: 7n } },
    });
  let training = noTraining;
  for (const event of [progress(1n, 10n, 3), progress(2n, 20n, 2), progress(3n, 10n, 2.5)])
    training = after(training, event);
  expect(training.loss).toEqual([{ step: 10, value: 2.5 }]);
  expect(training.sequence).toBe(3n);
});
