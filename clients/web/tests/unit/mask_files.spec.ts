import { expect, test } from '@playwright/test';
import { labelsJson, maskFiles } from '../../app/mask/mask_files';

const mask = (view: string) => ({
  view,
  rle: { width: 4, height: 3, counts: 'x' },
  area: 5,
  box: [0, 1, 2, 3],
  score: 0.9,
});

test('labels with the same text have a folder each', () => {
  const segments = [
    { id: 'cup', category: 'Cup', masks: [mask('a.jpg')] },
    { id: 'cup-2', category: 'Cup', masks: [mask('a.jpg')] },
  ];
  expect(maskFiles(segments).map(({ path }) => path)).toEqual(['cup/a.png', 'cup-2/a.png']);
  expect(JSON.parse(labelsJson(segments))).toEqual({ cup: 'Cup', 'cup-2': 'Cup' });
});

test('the text of a label is never a path', () => {
  const evil = { id: 'scene', category: '../../etc/cron.d/x', masks: [mask('cam0/a.jpg')] };
  expect(maskFiles([evil]).map(({ path }) => path)).toEqual(['scene/cam0/a.png']);
  expect(JSON.parse(labelsJson([evil]))).toEqual({ scene: '../../etc/cron.d/x' });
});

test('views that differ only in their suffix have a file each', () => {
  const segment = { id: 'cup', category: 'Cup', masks: [mask('a.jpg'), mask('a.png'), mask('b.jpg')] };
  expect(maskFiles([segment]).map(({ path }) => path)).toEqual([
    'cup/a.jpg.png',
    'cup/a.png.png',
    'cup/b.png',
  ]);
});
