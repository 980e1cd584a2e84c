// Masks that are changed by hand.
import { expect, test } from '@playwright/test';
import { emptyMask, outlined, withLine } from '../../app/mask/edit_mask';
import { encodeRle } from '../../app/mask/encode_rle';
import { largestPiece, withoutSmallPieces } from '../../app/mask/pieces';
import type { Rle } from '../../app/mask/rle';
import { decodeRle } from '../../app/mask/rle';
import { fakeSession, maskIn } from './fake_session';

/** Returns the rows of a mask, as in `drawn`. */
function rows(mask: Rle | undefined): string[] {
  if (!mask) return [];
  const pixels = decodeRle(mask);
  return Array.from({ length: mask.height }, (_, y) =>
    [...pixels.slice(y * mask.width, (y + 1) * mask.width)].map((on) => (on ? '#' : '.')).join(''),
  );
}

function drawn(...lines: string[]): Rle {
  const width = lines[0]?.length ?? 0;
  return encodeRle(width, lines.length, (x, y) => lines[y]?.[x] === '#');
}

const at = (x: number, y: number) => ({ x, y });

// The session listens to the page's network.
test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

test('an outline has the pixels whose middle it goes around', () => {
  const square = [at(1, 1), at(4.4, 1), at(4.4, 3.6), at(1, 3.6)];
  const inside = ['......', '.###..', '.###..', '.###..'];
  expect(rows(outlined(square, 6, 4))).toEqual(inside);
  expect(rows(outlined([...square].reverse(), 6, 4))).toEqual(inside);
  // Around twice is inside, and beyond the border is cut.
  expect(rows(outlined([...square, ...square], 6, 4))).toEqual(inside);
  expect(rows(outlined([at(-5, -5), at(9, -5), at(9, 1), at(-5, 1)], 3, 2))).toEqual(['###', '...']);
  const corner = [at(0, 0), at(4, 0), at(0, 4)];
  expect(rows(outlined(corner, 4, 4))).toEqual(['###.', '##..', '#...', '....']);
  expect(rows(outlined([at(1, 1)], 2, 2))).toEqual(['..', '..']);
});

test('a line is added to the mask, or taken from it, as wide as it is drawn', () => {
  const line = { path: [at(1.5, 1.5), at(4.5, 1.5)], width: 2 };
  const painted = withLine(emptyMask(6, 4), line, false);
  expect(rows(painted)).toEqual(['.####.', '######', '.####.', '......']);
  const thin = { path: [at(2.5, 1.5)], width: 0 };
  expect(rows(withLine(painted, thin, true))).toEqual(['.####.', '##.###', '.####.', '......']);
  expect(rows(withLine(painted, { path: [at(0, 0)], width: 40 }, true)).join('')).not.toContain('#');
});

test('the largest piece is kept, or small ones are dropped', () => {
  // Corners do not connect.
  const mask = drawn('##...#', '##...#', '..#...', '......');
  expect(rows(largestPiece(mask))).toEqual(['##....', '##....', '......', '......']);
  expect(largestPiece(drawn('###', '#.#'))).toBeUndefined();
  expect(withoutSmallPieces(mask)).toBeUndefined(); // 1 of 4 pixels is not small
  const wide = encodeRle(40, 3, (x, y) => x < 20 || (y === 0 && (x === 30 || x > 36)));
  // Pieces of 60, 1 and 3 pixels: a twentieth of 60 is 3.
  expect(rows(withoutSmallPieces(wide))[0]).toBe(`${'#'.repeat(20)}${'.'.repeat(17)}###`);
});

test('a mask that was changed stays as it is, with further changes, and is undone', async () => {
  const { session, answerWith, asked } = await fakeSession();
  const place = { view: 'a.jpg' };
  const first = drawn('##..', '....');
  session.addPoint(place, { x: 0.5, y: 0.5, negative: false });
  answerWith([maskIn('a.jpg', first, 2n), maskIn('b.jpg')]);
  const shown = () => rows(session.state.get().answer?.masks.get('a.jpg')?.rle);
  const inB = () => session.state.get().answer?.masks.get('b.jpg')?.area;

  session.edit('a.jpg', drawn('###.', '....'));
  // At once, and the other views keep theirs until they are answered.
  expect([shown()[0], inB()]).toEqual(['###.', 1]);
  expect(asked.at(-1)?.prompt?.what.case).toBe('mask');
  answerWith([maskIn('a.jpg', first, 2n), maskIn('b.jpg', drawn('##..', '....'), 2n)]);
  expect([shown()[0], inB()]).toEqual(['###.', 2]);

  session.edit('a.jpg', drawn('####', '....'));
  answerWith([maskIn('a.jpg', first, 2n)]);
  expect(shown()[0]).toBe('####');
  await session.history.undo();
  answerWith([maskIn('a.jpg', first, 2n)]);
  expect(shown()[0]).toBe('###.');
  await session.history.undo();
  answerWith([maskIn('a.jpg', first, 2n)]);
  expect(shown()[0]).toBe('##..');
  expect(session.state.get().prompt?.kind).toBe('points');

  // Nothing is left: the segment ends.
  session.edit('a.jpg', drawn('....', '....'));
  expect(session.state.get().prompt).toBeUndefined();
  session.end();
});

test('an outline is asked for, and the answer is the server’s', async () => {
  const { drawWith } = await import('../../app/scene/mask_tools');
  const { session, answerWith, asked } = await fakeSession();
  const path = [at(0, 0), at(3, 0), at(3, 2), at(0, 2)];
  const stroke = { path, negative: false, width: 0 };
  drawWith('lasso', session, 'a.jpg', { width: 4, height: 2 }, stroke);
  expect(session.state.get().answer).toBeUndefined();
  const what = asked[0]?.prompt?.what;
  const image = what?.case === 'mask' ? what.value.image : undefined;
  expect(image?.case === 'rle' && rows(image.value)).toEqual(['###.', '###.']);
  answerWith([maskIn('a.jpg', drawn('##..', '##..'), 4n)]);
  expect(rows(session.state.get().answer?.masks.get('a.jpg')?.rle)).toEqual(['##..', '##..']);

  // What is painted is added to that; what is erased from nothing is nothing.
  const dot = { path: [at(3.5, 0.5)], negative: false, width: 0 };
  drawWith('paint', session, 'a.jpg', { width: 4, height: 2 }, dot);
  expect(rows(session.state.get().answer?.masks.get('a.jpg')?.rle)).toEqual(['##.#', '##..']);
  session.clear();
  drawWith('erase', session, 'a.jpg', { width: 4, height: 2 }, { ...dot, negative: true });
  expect(session.state.get().prompt).toBeUndefined();
  drawWith('paint', session, 'a.jpg', { width: 4, height: 2 }, dot);
  expect(rows(session.state.get().answer?.masks.get('a.jpg')?.rle)).toEqual(['...#', '....']);
  session.end();
});
