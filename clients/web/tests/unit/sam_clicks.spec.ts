import { Code } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { SegmentViewsResponse_BorderImage as BorderImage } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { errorWith } from '../../contract/error_detail';
import { fakeSession, maskIn, replace, views } from './fake_session';
import { firstColumns } from './runs';

interface Asked {
  samClicks?: boolean;
  targets?: { views: string[] };
  granularity: { scale?: { case?: string }; threshold?: number };
}

const place = { view: 'b.jpg' };
const click = { x: 5, y: 5, negative: false };
const undo: (() => void)[] = [];
let asked: Asked[];
let hasSam: boolean;

const inView = (view: string, columns: number) =>
  maskIn(view, firstColumns(columns), BigInt(columns * 10));

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { segmentation } = await import('../../app/api/clients');
  asked = [];
  hasSam = true;
  const segmentViews = async (request: Asked) => {
    asked.push(request);
    if (request.samClicks && !hasSam) {
      throw errorWith(Code.FailedPrecondition, 'no SAM', { reason: 'NO_SAM' });
    }
    const borderImage = request.samClicks ? BorderImage.PHOTOGRAPH : BorderImage.UNSPECIFIED;
    const named = request.targets?.views ?? [''];
    const masks = named.map((view) => ({
      ...inView(view, request.samClicks ? 50 : 20),
      borderImage,
    }));
    return { masks, scaleQuantile: 0.4, scaleUnits: 1, threshold: 0.7 };
  };
  const proposal = { scaleQuantile: 0.9, threshold: 0.6, mask: inView('b.jpg', 90) };
  const proposeScales = async () => ({ proposals: [proposal], best: 0 });
  undo.push(replace(segmentation, { segmentViews, proposeScales }));
});
test.afterEach(() => {
  for (const back of undo.splice(0)) back();
  Reflect.deleteProperty(globalThis, 'window');
});

test('SAM answers clicks in all views after the model, the prompt’s view first', async () => {
  const { describeAnswer } = await import('../../app/scene/describe_answer');
  const { session, answerWith } = await fakeSession();
  const area = (view: string) => session.state.get().answer?.masks.get(view)?.area;
  const said = () => describeAnswer(session.state.get(), 'b.jpg', views);
  session.setSamClicks('on');
  session.addPoint(place, click);
  answerWith(['a.jpg', 'b.jpg'].map((view) => inView(view, 20)));
  expect(area('b.jpg')).toBe(200);
  expect(said()).toBe('200 pixels here. SAM is looking in 5 views …');
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked.map(({ targets }) => targets?.views)).toEqual([
    ['b.jpg', 'a.jpg'],
    ['c.jpg', 'd.jpg'],
    ['e.jpg'],
  ]);
  // The contract: for points without scale and threshold.
  for (const { samClicks, granularity } of asked) {
    expect(samClicks).toBe(true);
    expect([granularity.scale?.case, granularity.threshold]).toEqual([undefined, undefined]);
  }
  expect(views.map(area)).toEqual([500, 500, 500, 500, 500]);
  expect(said()).toBe('500 pixels here, by SAM in the photograph. Seen in 5 views.');
  // SAM's answer is a size, and the slider comes back to it without another request.
  const { ladder } = session.state.get();
  expect([ladder.rungs.map(({ mask }) => mask.area), ladder.at]).toEqual([[500, 900], 0]);
  const before = asked.length;
  session.climb(1);
  expect(area('b.jpg')).toBe(900);
  session.climb(0);
  expect([area('b.jpg'), asked.length]).toEqual([500, before]);
  session.end();
});

test('a chosen size is the model’s alone', async () => {
  const { session, answerWith } = await fakeSession();
  session.setSamClicks('on');
  session.show('b.jpg');
  session.addPoint(place, click);
  answerWith([inView('b.jpg', 20)]);
  await expect.poll(() => session.state.get().looking).toBe(false);
  asked = [];
  session.climb(1);
  session.rest();
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked.length).toBeGreaterThan(0);
  expect(asked.every(({ samClicks }) => !samClicks)).toBe(true);
  session.end();
});

test('SAM answers boxes, not strokes, and no clicks when it is turned off', async () => {
  const { session, answerWith, asked: streamed } = await fakeSession();
  session.setSamClicks('on');
  const dot = { path: [{ x: 5, y: 5 }], negative: false, width: 0 };
  session.pose({ kind: 'scribbles', place, strokes: [dot] });
  answerWith([inView('b.jpg', 20)]);
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked.every(({ samClicks }) => !samClicks)).toBe(true);
  asked = [];
  session.pose({ kind: 'box', place, box: { x: 0, y: 0, width: 5, height: 5 } });
  answerWith([inView('b.jpg', 20)]);
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked.every(({ samClicks }) => samClicks)).toBe(true);
  session.addPoint(place, click);
  answerWith([inView('b.jpg', 20)]);
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked.some(({ samClicks }) => samClicks)).toBe(true);
  const before = streamed.length;
  session.setSamClicks('off');
  expect(streamed).toHaveLength(before + 1);
  answerWith([inView('b.jpg', 20)]);
  expect(session.state.get().answer?.masks.get('b.jpg')?.area).toBe(200);
  session.end();
});

test('as suits the model: the server decides, and the text says who answered', async () => {
  const { describeAnswer } = await import('../../app/scene/describe_answer');
  const { session, answerWith } = await fakeSession();
  const said = () => describeAnswer(session.state.get(), 'b.jpg', views);
  session.setSamClicks('auto');
  session.addPoint(place, click);
  answerWith([inView('b.jpg', 20)]);
  expect(said()).toBe('200 pixels here. Looking in 5 views …');
  await expect.poll(() => session.state.get().looking).toBe(false);
  // The field is as in a request that does not speak of SAM.
  const { segmentRequest } = await import('../../app/scene/prompt');
  const unset = segmentRequest('m', { kind: 'label', label: 'cup' }, {}).samClicks;
  expect(asked.map(({ samClicks }) => samClicks)).toEqual([unset, unset, unset]);
  expect(said()).toBe('200 pixels here, by the model. Seen in 5 views.');
  // Without SAM the contract wants it said: absent is the server's choice.
  asked = [];
  session.setSamClicks('off');
  answerWith([inView('b.jpg', 20)]);
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked.length).toBeGreaterThan(0);
  expect(asked.every(({ samClicks }) => samClicks === false)).toBe(true);
  expect(said()).toBe('200 pixels here. Seen in 5 views.');
  session.end();
});

test('without SAM the model’s answer stays, and the failure says so', async () => {
  hasSam = false;
  const { session, answerWith } = await fakeSession();
  session.setSamClicks('on');
  session.addPoint(place, click);
  answerWith([inView('b.jpg', 20)]);
  await expect.poll(() => session.state.get().failure?.reason).toBe('NO_SAM');
  expect(session.state.get().answer?.masks.get('b.jpg')?.area).toBe(200);
  session.end();
});

test('a click in 3D is answered in its picture first', async () => {
  const camera = { width: 4, height: 4 } as never;
  const { session, answerWith } = await fakeSession();
  session.setSamClicks('on');
  session.addPoint({ camera }, click);
  answerWith([inView('', 20)]);
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked[0]?.targets).toBeUndefined();
  expect(session.state.get().answer?.masks.get('')?.area).toBe(500);
  session.end();
});

test('a click that takes its preview is refined by SAM as another one', async () => {
  const { session, previews, asked: streamed } = await fakeSession();
  const area = () => session.state.get().answer?.masks.get('b.jpg')?.area;
  session.setSamClicks('on');
  session.show('b.jpg');
  session.hover.move('b.jpg', click, 0);
  previews[0]?.answer([inView('b.jpg', 20)]);
  session.addPoint(place, click);
  expect([area(), streamed.length]).toEqual([200, 1]);
  expect(session.state.get().current.size).toBe(0); // SAM has the last word
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(area()).toBe(500);
  expect(asked[0]).toMatchObject({ samClicks: true, targets: { views: ['b.jpg'] } });
  session.end();
});
