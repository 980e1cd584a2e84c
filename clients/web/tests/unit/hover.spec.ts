// The preview of a click under the pointer: what is asked when, and what a click makes of it.
import { expect, test } from '@playwright/test';
import type { FakeSession } from './fake_session';
import { fakeSession, maskIn } from './fake_session';
import { firstColumns } from './runs';

const at = (x: number, negative = false) => ({ x, y: 4.2, negative });
const inA = (columns: number) => [maskIn('a.jpg', firstColumns(columns), BigInt(columns * 10))];
const place = { view: 'a.jpg' };

/** The x of the points that a preview asks for. */
const pointsOf = (fake: FakeSession, index: number) => {
  const what = fake.previews[index]?.request.prompt?.what;
  return what?.case === 'points' ? what.value.points.map(({ x }) => x) : [];
};

// The session listens to the page's network.
test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
  Reflect.deleteProperty(globalThis, 'localStorage');
});

test('one request is computed at a time, then the newest position is asked', async () => {
  const fake = await fakeSession();
  const { hover } = fake.session;
  for (const x of [5.1, 6.1, 7.1, 8.7]) hover.move('a.jpg', at(x), 0);
  expect(fake.previews).toHaveLength(1);
  expect(fake.previews[0]?.request.targets?.views).toEqual(['a.jpg']);
  fake.previews[0]?.answer(inA(20));
  expect(hover.state.get()).toMatchObject({ at: '5,4', mask: { area: 200 } });
  expect(fake.previews).toHaveLength(2);
  expect(pointsOf(fake, 1)).toEqual([8.5]);
  fake.previews[1]?.answer(inA(30));
  // Within the pixel that is answered nothing is asked.
  hover.move('a.jpg', at(8.2), 0);
  expect(fake.previews).toHaveLength(2);
  expect(hover.state.get()).toMatchObject({ at: '8,4', mask: { area: 300 } });
  // It is a preview: nothing is segmented.
  const { prompt, answer, busy, numAnswers } = fake.session.state.get();
  expect([prompt, answer, busy, numAnswers]).toEqual([undefined, undefined, false, 0]);
  fake.session.end();
});

test('it goes when the pointer leaves, and an answer that comes later is not shown', async () => {
  const { session, previews } = await fakeSession();
  const { hover } = session;
  hover.move('a.jpg', at(5), 0);
  previews[0]?.answer(inA(20));
  hover.move('a.jpg', at(6), 0);
  hover.leave();
  expect(hover.state.get()).toMatchObject({ at: '', mask: undefined });
  previews[1]?.answer(inA(30));
  expect(hover.state.get()).toMatchObject({ at: '', mask: undefined });
  // Also when another view is shown.
  hover.move('a.jpg', at(7), 0);
  previews[2]?.answer(inA(30));
  expect(hover.state.get().mask).toBeDefined();
  session.show('b.jpg');
  expect(hover.state.get()).toMatchObject({ at: '', mask: undefined });
  session.end();
});

test('while a button is held nothing is asked, and what is shown stays', async () => {
  const { session, previews } = await fakeSession();
  const { hover } = session;
  hover.move('a.jpg', at(5), 0);
  hover.move('a.jpg', at(6), 0);
  hover.hold();
  previews[0]?.answer(inA(20));
  expect(previews).toHaveLength(1);
  expect(hover.state.get().mask?.area).toBe(200);
  hover.move('a.jpg', at(6), 0);
  expect(previews).toHaveLength(2);
  session.end();
});

test('a click in the same pixel takes the answer, without another request', async () => {
  const { session, asked, previews } = await fakeSession();
  session.hover.move('a.jpg', at(5.1), 0);
  previews[0]?.answer(inA(20));
  session.hover.hold();
  session.addPoint(place, at(5.9));
  const { prompt, answer, busy, numAnswers, current } = session.state.get();
  expect(answer?.masks.get('a.jpg')?.area).toBe(200);
  expect([busy, numAnswers, [...current]]).toEqual([false, 1, ['a.jpg']]);
  expect(prompt).toMatchObject({ points: [{ x: 5.5, y: 4.5, negative: false }] });
  expect(asked).toHaveLength(1);
  expect(session.hover.state.get().mask).toBeUndefined();
  await session.history.undo();
  expect(session.state.get().prompt).toBeUndefined();
  session.end();
});

test('a click elsewhere, or on what is not meant, asks', async () => {
  const { session, asked, previews, answerWith } = await fakeSession();
  session.hover.move('a.jpg', at(5), 0);
  previews[0]?.answer(inA(20));
  session.addPoint(place, at(9));
  expect([asked.length, previews.length]).toEqual([2, 1]);
  expect(session.state.get().answer).toBeUndefined();
  answerWith(inA(40));
  expect(session.state.get().answer?.masks.get('a.jpg')?.area).toBe(400);
  session.hover.move('a.jpg', at(20), 0);
  previews[1]?.answer(inA(30));
  session.addPoint(place, at(20, true));
  expect([asked.length, previews.length]).toEqual([4, 2]);
  session.end();
});

test('a click ends the preview that is on its way, until the pointer leaves the click', async () => {
  const { session, asked, previews, answerWith } = await fakeSession();
  const { hover } = session;
  hover.move('a.jpg', at(5), 3);
  session.addPoint(place, at(5));
  previews[0]?.answer(inA(20));
  expect([asked.length, hover.state.get().mask]).toEqual([2, undefined]);
  // Nothing is asked while the session waits, nor where the click was.
  hover.move('a.jpg', at(30), 3);
  expect(previews).toHaveLength(1);
  answerWith(inA(40));
  expect(previews).toHaveLength(2);
  previews[1]?.answer(inA(50));
  session.addPoint(place, at(30));
  hover.move('a.jpg', at(31), 3);
  expect([previews.length, hover.state.get().mask]).toEqual([2, undefined]);
  hover.move('a.jpg', at(40), 3);
  expect(previews).toHaveLength(3);
  session.end();
});

test('while a prompt has points, the preview is of the next one', async () => {
  const fake = await fakeSession();
  const { session, previews, answerWith } = fake;
  session.hover.move('a.jpg', at(5, true), 0);
  // The first mark cannot be of what is not meant.
  expect([previews.length, session.hover.state.get().mask]).toEqual([0, undefined]);
  session.addPoint(place, at(5));
  answerWith(inA(20));
  session.hover.move('a.jpg', at(50, true), 0);
  expect(pointsOf(fake, 0)).toEqual([5, 50.5]);
  // Without the prompt it is outdated.
  session.clear();
  previews[0]?.answer(inA(10));
  expect(session.hover.state.get().mask).toBeUndefined();
  session.end();
});

test('where nothing is, nothing is shown, and the next position is asked', async () => {
  const { session, previews } = await fakeSession();
  session.hover.move('a.jpg', at(5), 0);
  previews[0]?.answer(inA(20));
  session.hover.move('a.jpg', at(6), 0);
  session.hover.move('a.jpg', at(7), 0);
  previews[1]?.refuse();
  expect(session.hover.state.get()).toMatchObject({ at: '6,4', mask: undefined });
  expect(session.state.get().failure).toBeUndefined();
  expect(previews).toHaveLength(3);
  session.end();
});

test('a chosen size that does not fit is left to the server, as by a click', async () => {
  const { session, previews, answerWith } = await fakeSession();
  const { segmentation } = await import('../../app/api/clients');
  const { replace } = await import('./fake_session');
  const proposal = { scaleQuantile: 0.9, threshold: 0.6, mask: inA(60)[0] };
  const undo = replace(segmentation, {
    proposeScales: async () => ({ proposals: [proposal], best: 0 }),
    segmentViews: async () => ({ masks: [], scaleQuantile: 0.4, scaleUnits: 1, threshold: 0.7 }),
  });
  try {
    session.addPoint(place, at(5));
    answerWith(inA(20));
    await expect.poll(() => session.state.get().ladder.rungs.length).toBe(2);
    session.climb(1);
    session.hover.move('a.jpg', at(80), 0);
    expect(previews[0]?.request.granularity?.threshold).toBe(0.6);
    previews[0]?.answer(inA(60)); // without the pixel
    expect(previews[1]?.request.granularity?.threshold).toBeUndefined();
    expect(session.hover.state.get().mask).toBeUndefined();
    previews[1]?.answer(inA(90));
    session.addPoint(place, at(80));
    const { answer, granularity } = session.state.get();
    expect([answer?.masks.get('a.jpg')?.area, granularity]).toEqual([900, {}]);
  } finally {
    undo();
    session.end();
  }
});

test('an answer that is late is said to be, until it comes or the pointer leaves', async () => {
  const { session, previews } = await fakeSession();
  const late = () => session.hover.state.get().isLate;
  session.hover.move('a.jpg', at(5), 0);
  expect(late()).toBe(false);
  await expect.poll(late).toBe(true);
  previews[0]?.answer(inA(20));
  expect(late()).toBe(false);
  session.hover.move('a.jpg', at(6), 0);
  await expect.poll(late).toBe(true);
  session.hover.leave();
  expect(late()).toBe(false);
  session.end();
});

test('the switch is remembered', async () => {
  const stored = new Map<string, string>();
  const localStorage = {
    getItem: (name: string) => stored.get(name) ?? null,
    setItem: (name: string, value: string) => void stored.set(name, value),
  };
  Object.assign(globalThis, { localStorage });
  const first = await fakeSession();
  first.session.hover.turn(false);
  first.session.hover.move('a.jpg', at(5), 0);
  expect(first.previews).toHaveLength(0);
  const second = await fakeSession();
  expect(second.session.hover.state.get().isOn).toBe(false);
  second.session.hover.turn(true);
  const third = await fakeSession();
  expect(third.session.hover.state.get().isOn).toBe(true);
  for (const { session } of [first, second, third]) session.end();
});
