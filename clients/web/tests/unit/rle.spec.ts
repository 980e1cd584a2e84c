import { expect, test } from '@playwright/test';
import { shrunkMask } from '../../app/mask/paint';
import { decodeRle, intersectionOverUnion, overlapOf, runsOf } from '../../app/mask/rle';
import { encode, firstColumns } from './runs';

test('runs can be decoded after encoding, also long and shrinking ones', () => {
  for (const runs of [
    [5],
    [0, 9],
    [1, 2, 3, 4, 5],
    [100000, 3, 7, 50000, 1, 2],
    [16, 15, 31, 32, 33, 1],
  ]) {
    expect(runsOf(encode(runs))).toEqual(runs);
  }
});

test('a string of pycocotools is read', () => {
  // mask.encode(np.asfortranarray([[0, 1], [1, 1]], dtype=uint8))["counts"]
  expect([...decodeRle({ width: 2, height: 2, counts: '13' })]).toEqual([0, 1, 1, 1]);
});

test('columns come first', () => {
  // 3 wide, 2 high: runs 1 0, 3 1, 2 0 down the columns.
  expect([...decodeRle({ width: 3, height: 2, counts: encode([1, 3, 2]) })]).toEqual([
    0, 1, 0, 1, 1, 0,
  ]);
});

test('excess pixels are ignored, wrong characters are an error', () => {
  expect([...decodeRle({ width: 1, height: 2, counts: encode([0, 9]) })]).toEqual([1, 1]);
  expect(() => runsOf('1 3')).toThrow();
});

test('intersection over union', () => {
  expect(intersectionOverUnion(Uint8Array.of(1, 1, 0), Uint8Array.of(0, 1, 1))).toBeCloseTo(1 / 3);
  expect(intersectionOverUnion(new Uint8Array(3), new Uint8Array(3))).toBe(0);
});

test('the overlap of run lengths is that of their pixels', () => {
  const masks = [
    [0, 600, 400],
    [7, 5, 300, 411, 277],
    [1000],
    [999, 1],
    [0, 1000],
    [3, 1, 3, 1, 3, 1, 988],
  ].map((runs) => ({ width: 100, height: 10, counts: encode(runs) }));
  for (const a of masks) {
    for (const b of masks)
      expect(overlapOf(a, b)).toBe(intersectionOverUnion(decodeRle(a), decodeRle(b)));
  }
  expect(overlapOf(firstColumns(5), firstColumns(5, 50))).toBe(0);
});

test('a drawn mask is not larger than the screen', () => {
  const large = { width: 400, height: 200, counts: encode([200 * 200, 200 * 200]) };
  const { width, height, pixels } = shrunkMask(large, 40);
  expect([width, height]).toEqual([40, 20]);
  expect([pixels[0], pixels[19], pixels[20], pixels[39]]).toEqual([0, 0, 1, 1]);
  expect(shrunkMask(large, 400).pixels).toEqual(decodeRle(large));
});
