import { expect, test } from '@playwright/test';
import type { FakeSession } from './fake_session';
import { answerIn, fakeSession, maskIn, replace } from './fake_session';
import { firstColumns } from './runs';

const place = { view: 'a.jpg' };
const undo: (() => void)[] = [];
let numProposals: number;
let others: { views: string[]; scale: number | undefined }[];

function sized(columns: number, view = 'a.jpg') {
  return maskIn(view, firstColumns(columns), BigInt(columns * 10));
}

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { segmentation } = await import('../../app/api/clients');
  numProposals = 0;
  others = [];
  const proposal = (columns: number) => ({
    scaleQuantile: columns / 100,
    threshold: 0.7,
    mask: sized(columns),
  });
  const proposeScales = async () => {
    ++numProposals;
    return { proposals: [10, 30, 60, 90].map(proposal), best: 1 };
  };
  const segmentViews = async (request: {
    targets: { views: string[] };
    granularity: { scale: { value: number } };
  }) => {
    const { views } = request.targets;
    others.push({ views, scale: request.granularity.scale.value });
    return answerIn(...views);
  };
  undo.push(replace(segmentation, { proposeScales, segmentViews }));
});
test.afterEach(() => {
  for (const back of undo.splice(0)) back();
  Reflect.deleteProperty(globalThis, 'window');
});

/** Clicks, and waits for the sizes. The answer is the second of them. */
async function clicked(): Promise<FakeSession> {
  const fake = await fakeSession();
  fake.session.addPoint(place, { x: 5, y: 5, negative: false });
  fake.answerWith([sized(30)], { scaleQuantile: 0.3, threshold: 0.7 });
  await expect.poll(() => fake.session.state.get().ladder.isCurrent).toBe(true);
  await expect.poll(() => fake.session.state.get().looking).toBe(false);
  return fake;
}

function shown({ session }: FakeSession) {
  const { ladder, answer, granularity, busy } = session.state.get();
  return { at: ladder.at, area: answer?.masks.get('a.jpg')?.area, granularity, busy };
}

test('the slider shows a proposal at once, without a request', async () => {
  const fake = await clicked();
  expect(shown(fake)).toEqual({ at: 1, area: 300, granularity: {}, busy: false });
  others = [];
  fake.session.climb(2);
  fake.session.climb(3);
  const chosen = { scale: 0.9, threshold: 0.7 };
  expect(shown(fake)).toEqual({ at: 3, area: 900, granularity: chosen, busy: false });
  expect([fake.asked.length, others.length, numProposals]).toEqual([1, 0, 1]);
  // When it rests, the other views follow, at that size; the prompt's own view is not asked for.
  fake.session.rest();
  await expect.poll(() => fake.session.state.get().looking).toBe(false);
  expect(others.flatMap(({ views }) => views)).toEqual(['b.jpg', 'c.jpg', 'd.jpg', 'e.jpg']);
  expect(others.every(({ scale }) => scale === 0.9)).toBe(true);
  expect([fake.asked.length, numProposals]).toEqual([1, 1]);
  expect(shown(fake).area).toBe(900);
  fake.session.end();
});

test('another view than the prompt’s follows by the stream', async () => {
  const fake = await clicked();
  fake.session.show('c.jpg');
  await expect.poll(() => fake.session.state.get().looking).toBe(false);
  fake.session.climb(0);
  const [, request] = fake.asked;
  expect(request?.targets?.views).toEqual(['c.jpg']);
  expect(request?.granularity?.scale.value).toBe(0.1);
  fake.answerWith([sized(7, 'c.jpg')], { scaleQuantile: 0.1, threshold: 0.7 });
  expect(fake.session.state.get().answer?.masks.get('c.jpg')?.area).toBe(70);
  expect(shown(fake)).toMatchObject({ at: 0, area: 100, busy: false });
  fake.session.end();
});

test('a move of the slider is one step for undo', async () => {
  const fake = await clicked();
  fake.session.climb(2);
  fake.session.climb(3);
  fake.session.rest();
  await fake.session.history.undo();
  expect(fake.session.state.get()).toMatchObject({ granularity: {}, prompt: { kind: 'points' } });
  await fake.session.history.undo();
  expect(fake.session.state.get().prompt).toBeUndefined();
  fake.session.end();
});

test('the size stays with a further click that it fits', async () => {
  const fake = await clicked();
  fake.session.climb(2);
  fake.session.rest();
  fake.session.addPoint(place, { x: 50, y: 5, negative: false });
  // The slider keeps its place until the new sizes are there.
  expect(fake.session.state.get().ladder).toMatchObject({ at: 2, isCurrent: false });
  expect(fake.asked.at(-1)?.granularity?.scale.value).toBe(0.6);
  fake.answerWith([sized(61)], { scaleQuantile: 0.6, threshold: 0.7 });
  await expect.poll(() => fake.session.state.get().ladder.isCurrent).toBe(true);
  expect(shown(fake)).toMatchObject({ at: 2, area: 610, granularity: { scale: 0.6 } });
  fake.session.end();
});

test('a size that does not fit a further click is chosen again by the server', async () => {
  const fake = await clicked();
  fake.session.climb(0);
  fake.session.rest();
  fake.session.addPoint(place, { x: 80, y: 5, negative: false });
  fake.answerWith([sized(10)], { scaleQuantile: 0.1, threshold: 0.7 });
  const [, , request] = fake.asked;
  expect(request?.granularity?.scale.case).toBeUndefined();
  fake.answerWith([sized(90)], { scaleQuantile: 0.9, threshold: 0.7 });
  await expect.poll(() => fake.session.state.get().ladder.isCurrent).toBe(true);
  expect(shown(fake)).toEqual({ at: 3, area: 900, granularity: {}, busy: false });
  fake.session.end();
});

test('a scale of one’s own is a size of its own, and stays with further clicks', async () => {
  const fake = await clicked();
  fake.session.drag({ scale: 0.2 });
  fake.answerWith([sized(20)], { scaleQuantile: 0.2, threshold: 0.7 });
  const { rungs, at } = fake.session.state.get().ladder;
  expect([rungs.length, at, rungs[1]?.mask.area]).toEqual([5, 1, 200]);
  fake.session.addPoint(place, { x: 80, y: 5, negative: false });
  fake.answerWith([sized(20)], { scaleQuantile: 0.2, threshold: 0.7 });
  expect(shown(fake).granularity).toEqual({ scale: 0.2, threshold: 0.7 });
  fake.session.end();
});
