import { Code } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { errorWith } from '../../contract/error_detail';
import { continued, firstBrush, strokeWidth, withWidth } from '../../app/scene/brush';
import type { Prompt, Stroke } from '../../app/scene/prompt';
import { segmentRequest } from '../../app/scene/prompt';
import { fakeSession } from './fake_session';
import { firstColumns } from './runs';

const place = { view: 'a.jpg' };
const over: Stroke = {
  path: [
    { x: 2, y: 3 },
    { x: 9, y: 5 },
  ],
  negative: false,
  width: 4,
};
const beside: Stroke = { path: [{ x: 60, y: 5 }], negative: true, width: 4 };
const click = { x: 5, y: 5, negative: false };

// The session listens to the page's network.
test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

test('strokes are asked for as they are drawn, and undone one by one', async () => {
  const { session, answer, asked } = await fakeSession();
  session.addStroke(place, over);
  answer('a.jpg');
  session.addStroke(place, beside);
  answer('a.jpg');
  const what = asked.at(-1)?.prompt?.what;
  expect(what?.case).toBe('scribbles');
  expect(what?.value).toMatchObject({ strokes: [over, beside] });
  expect(asked.at(-1)?.prompt?.view?.place).toEqual({ case: 'view', value: 'a.jpg' });
  await session.history.undo();
  expect(session.state.get().prompt).toMatchObject({ kind: 'scribbles', strokes: [over] });
  await session.history.undo();
  expect(session.state.get().prompt).toBeUndefined();
  session.end();
});

test('clicks and strokes in a view are about one thing', async () => {
  const { session, answer } = await fakeSession();
  session.addPoint(place, click);
  answer('a.jpg');
  session.addStroke(place, beside);
  answer('a.jpg');
  const dot = { path: [{ x: 5, y: 5 }], negative: false, width: 0 };
  expect(session.state.get().prompt).toMatchObject({ strokes: [dot, beside] });
  session.addPoint(place, { x: 70, y: 5, negative: true });
  expect(session.state.get().prompt).toMatchObject({
    strokes: [dot, beside, { path: [{ x: 70, y: 5 }], negative: true, width: 0 }],
  });
  // In another view another thing begins.
  session.addStroke({ view: 'b.jpg' }, over);
  expect(session.state.get().prompt).toMatchObject({ strokes: [over] });
  session.end();
});

test('strokes over nothing that is meant, and too many of them, are not sent', async () => {
  const { session, asked } = await fakeSession();
  session.addStroke(place, beside);
  expect(session.state.get().failure?.what).toBe('Nothing is included yet.');
  const path = Array.from({ length: 4097 }, (_, x) => ({ x, y: 0 }));
  session.addStroke(place, { path, negative: false, width: 0 });
  expect(session.state.get().failure?.what).toBe('The strokes together are too long.');
  expect([asked.length, session.state.get().prompt]).toEqual([0, undefined]);
});

test('a stroke on nothing is marked at its end, and taken back', async () => {
  const { session, answer, refuse } = await fakeSession();
  session.addStroke(place, over);
  answer('a.jpg');
  session.addStroke(place, { ...over, path: [...over.path, { x: 90, y: 8 }] });
  refuse(errorWith(Code.InvalidArgument, 'nothing', { reason: 'NOTHING_THERE' }));
  const { miss, prompt, answer: before } = session.state.get();
  expect(miss).toEqual({ place, x: 90, y: 8 });
  expect(prompt).toMatchObject({ strokes: [over] });
  expect(before).toBeDefined();
  session.end();
});

test('sizes are proposed for the middles of strokes', async () => {
  const { pointsFor } = await import('../../app/scene/extend_prompt');
  const path = [1, 2, 3, 4, 5].map((x) => ({ x, y: x }));
  const strokes = [{ ...over, path }, beside];
  expect(pointsFor({ kind: 'scribbles', place, strokes })).toEqual({
    kind: 'points',
    place,
    points: [
      { x: 3, y: 3, negative: false },
      { x: 60, y: 5, negative: true },
    ],
  });
  const many = [over, ...Array.from({ length: 100 }, () => beside)];
  const points = pointsFor({ kind: 'scribbles', place, strokes: many });
  const negative = points?.kind === 'points' ? points.points.map((point) => point.negative) : [];
  expect([negative.length, negative[0], negative[1]]).toEqual([64, false, true]);
  expect(pointsFor({ kind: 'label', label: 'scenes/a/labels/b' })).toBeUndefined();
});

test('a mask agrees with marks inside it, and with negative ones outside', async () => {
  const { agreesWith } = await import('../../app/scene/extend_prompt');
  const half = firstColumns(50);
  const points = (...xs: [number, boolean][]): Prompt => ({
    kind: 'points',
    place,
    points: xs.map(([x, negative]) => ({ x, y: 5, negative })),
  });
  expect(agreesWith(half, points([5, false], [60, true]))).toBe(true);
  expect(agreesWith(half, points([5, false], [60, false]))).toBe(false);
  expect(agreesWith(half, points([5, false], [20, true]))).toBe(false);
  // A pixel next to the border is on either side of it.
  expect(agreesWith(half, points([50.5, false], [49.5, true]))).toBe(true);
  // Most of a stroke counts.
  const slipped = (xs: number[]): Prompt => ({
    kind: 'scribbles',
    place,
    strokes: [{ ...over, path: xs.map((x) => ({ x, y: 5 })) }],
  });
  expect(agreesWith(half, slipped([10, 30, 60]))).toBe(true);
  expect(agreesWith(half, slipped([10, 70, 60]))).toBe(false);
});

test('the brush is as wide on the screen whatever the size of the photograph', () => {
  expect(strokeWidth(firstBrush, 640)).toBe(8);
  expect(strokeWidth(firstBrush, 1280)).toBe(16);
  // The contract's limit.
  expect(strokeWidth(withWidth(firstBrush, 1000), 12_000)).toBe(256);
  expect(withWidth(firstBrush, -3).width).toBe(2);
  const far = continued(over, { x: 30, y: 5 }, 640);
  expect(far.path).toHaveLength(3);
  expect(continued(far, { x: 31, y: 5 }, 640)).toBe(far);
});

test('a stroke is sent with its scale and threshold, if those are chosen', () => {
  const prompt: Prompt = { kind: 'scribbles', place, strokes: [over] };
  const { granularity } = segmentRequest('m', prompt, { scale: 0.2, threshold: 0.5 });
  expect(granularity).toMatchObject({ threshold: 0.5, scale: { value: 0.2 } });
});
