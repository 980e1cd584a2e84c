import { expect, test } from '@playwright/test';
import { readGreyPng } from '../../app/mask/grey_png';
import { pngOf } from './grey_pngs';

const values = Array.from({ length: 7 * 11 }, (_, i) => (i * 7919 + (i % 7) * 301) % 65536);

test('16-bit grey is read exactly, whatever the filters', () => {
  for (const numParts of [1, 3]) {
    const picture = readGreyPng(pngOf(7, values, numParts));
    expect([picture.width, picture.height]).toEqual([7, 11]);
    expect([...picture.values]).toEqual(values);
  }
});

test('other pictures, and those that are cut off, are errors', () => {
  expect(() => readGreyPng(Buffer.from('dear diary'))).toThrow('not a PNG');
  expect(() => readGreyPng(pngOf(7, values, 1, 8))).toThrow('16-bit grey');
  const taller = pngOf(7, values);
  taller.writeUInt32BE(12, 20);
  expect(() => readGreyPng(taller)).toThrow('cut off');
});
