import { expect, test } from '@playwright/test';
import { encodeRle } from '../../app/mask/encode_rle';
import type { GreyPicture } from '../../app/mask/grey_png';
import { segmentWords, shrunkGrey } from '../../app/mask/paint_segments';
import { decodeRle } from '../../app/mask/rle';
import { idAt, maskOfSegment, seenSegments, segmentColor } from '../../app/scene/segments';
import { firstColumns } from './runs';

/** Ids of two segments, and a column of none. */
const picture: GreyPicture = {
  width: 5,
  height: 3,
  values: Uint16Array.from([1, 1, 2, 2, 0, 1, 1, 2, 2, 0, 1, 2, 2, 2, 0]),
};

test('a mask of pixels has the run lengths of pycocotools', () => {
  expect(encodeRle(100, 10, (x) => x < 7)).toEqual(firstColumns(7));
  // Long runs and differences of either sign.
  const isInside = (x: number, y: number) => (x * x + y * 3) % 7 < 3 || x > 90;
  const pixels = decodeRle(encodeRle(100, 60, isInside));
  expect([...pixels].every((value, i) => (value === 1) === isInside(i % 100, Math.floor(i / 100)))).toBe(true);
  expect(decodeRle(encodeRle(3, 2, () => false))).toEqual(new Uint8Array(6));
  expect(decodeRle(encodeRle(3, 2, () => true))).toEqual(new Uint8Array(6).fill(1));
});

test('colours of segments are those of pepeseg decompose, and differ', () => {
  // As in the files ..._colors.png of `pepeseg decompose --out`.
  expect(segmentColor(1)).toEqual([86, 117, 191]);
  expect(segmentColor(2)).toEqual([148, 230, 34]);
  expect(segmentColor(3)).toEqual([255, 115, 238]);
  const near = Array.from({ length: 12 }, (_, i) => segmentColor(i + 1).join());
  expect(new Set(near).size).toBe(12);
});

test('a segment is found at a position, and its mask has the photograph’s size', () => {
  const size = { width: 10, height: 6 };
  expect(idAt(picture, size, 0.2, 0.2)).toBe(1);
  expect(idAt(picture, size, 3.9, 5.9)).toBe(2);
  expect(idAt(picture, size, 9.9, 3)).toBe(0);
  const mask = maskOfSegment(picture, size, 1);
  expect([mask.width, mask.height]).toEqual([10, 6]);
  const pixels = decodeRle(mask);
  const rows = Array.from({ length: 6 }, (_, y) => [...pixels.slice(y * 10, y * 10 + 10)].join(''));
  const [upper, lower] = ['1111000000', '1100000000'];
  expect(rows).toEqual([upper, upper, upper, upper, lower, lower]);
  expect(seenSegments(picture)).toEqual([
    { id: 2, area: 7 },
    { id: 1, area: 5 },
  ]);
});

test('segments have their colours, borders, and no fill where they are hidden', () => {
  const draw = (style: Partial<Parameters<typeof segmentWords>[1]>) =>
    segmentWords(picture, {
      colorOf: (id) => [id, 0, 0],
      emphasised: 0,
      isHidden: () => false,
      isFaint: false,
      ...style,
    });
  const alpha = (words: Uint32Array, i: number) => (words[i] as number) >>> 24;
  const plain = draw({});
  expect([0, 3].map((i) => (plain[i] as number) & 0xff)).toEqual([1, 2]);
  expect(plain[2]).toBe(0xb4ffffff); // the border is on the right segment
  expect(plain[4]).toBe(0xb4ffffff);
  const emphasised = draw({ emphasised: 2 });
  expect(alpha(emphasised, 3)).toBeGreaterThan(alpha(plain, 3));
  expect(alpha(emphasised, 0)).toBe(alpha(plain, 0));
  expect(emphasised[2]).toBe(0xff000000);
  const hidden = draw({ isHidden: (id) => id === 1 });
  expect([alpha(hidden, 0), alpha(hidden, 3)]).toEqual([0, alpha(plain, 3)]);
  const faint = draw({ isFaint: true, emphasised: 2 });
  expect([alpha(faint, 0), faint[2]]).toEqual([0, 0xff000000]);
  expect(alpha(faint, 3)).toBeGreaterThan(0);
});

test('a large picture is drawn smaller', () => {
  const { width, height, values } = shrunkGrey(picture, 2);
  expect([width, height, ...values]).toEqual([2, 1, 1, 2]);
  expect(shrunkGrey(picture, 5)).toBe(picture);
});
