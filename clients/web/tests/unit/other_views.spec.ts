import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { errorWith } from '../../contract/error_detail';
import { answerIn, fakeSession, firstRow, maskIn, model, replace, views } from './fake_session';

const undo: (() => void)[] = [];

test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  for (const back of undo.splice(0)) back();
  Reflect.deleteProperty(globalThis, 'window');
});

/** A call that a test answers. */
interface Waiting {
  readonly views: readonly string[];
  readonly answer: () => void;
}

test('proposals and views are asked for at once, and the strip fills as views are answered', async () => {
  const { segmentation } = await import('../../app/api/clients');
  const { describeAnswer } = await import('../../app/scene/describe_answer');
  const waiting: Waiting[] = [];
  let numProposals = 0;
  const segmentViews = (request: { targets: { views: string[] } }) =>
    new Promise((resolve) => {
      const named = request.targets.views;
      waiting.push({ views: named, answer: () => resolve(answerIn(...named)) });
    });
  const proposeScales = () => {
    ++numProposals;
    return new Promise(() => undefined); // the proposals take longer than this test
  };
  undo.push(replace(segmentation, { segmentViews, proposeScales }));
  const { session, answer } = await fakeSession();
  const said = () => describeAnswer(session.state.get(), 'a.jpg', views);
  session.addPoint({ view: 'a.jpg' }, { x: 0.5, y: 0.5, negative: false });
  expect(said()).toBe('Looking …');
  answer('a.jpg');
  expect(said()).toBe('1 pixels here. Looking in 4 other views …');
  await expect.poll(() => waiting.length).toBe(1);
  expect(numProposals).toBe(1);
  expect(waiting[0]?.views).toEqual(['b.jpg', 'c.jpg']);
  waiting[0]?.answer();
  await expect.poll(() => waiting.length).toBe(2);
  expect([...(session.state.get().answer?.masks.keys() ?? [])]).toEqual(['a.jpg', 'b.jpg', 'c.jpg']);
  expect(said()).toBe('1 pixels here. Looking in 2 other views …');
  waiting[1]?.answer();
  await expect.poll(said).toBe('1 pixels here. Seen in 5 views.');
  session.end();
});

test('a view that somebody turns to is looked at next', async () => {
  const { segmentation } = await import('../../app/api/clients');
  const asked: string[][] = [];
  const segmentViews = ({ targets }: { targets: { views: string[] } }) => {
    asked.push(targets.views);
    return Promise.resolve(answerIn(...targets.views));
  };
  undo.push(replace(segmentation, { segmentViews, proposeScales: async () => ({ proposals: [] }) }));
  const { session, answer } = await fakeSession();
  session.addPoint({ view: 'a.jpg' }, { x: 0.5, y: 0.5, negative: false });
  answer('a.jpg');
  session.show('d.jpg');
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(asked).toEqual([['d.jpg', 'e.jpg'], ['b.jpg', 'c.jpg']]);
  session.end();
});

test('other views of clicks get what the server chooses, those of a box its scale', async () => {
  const { segmentation } = await import('../../app/api/clients');
  const scales: unknown[] = [];
  const segmentViews = (request: {
    targets: { views: string[] };
    granularity: { scale: { value?: number } };
  }) => {
    scales.push(request.granularity.scale.value);
    return Promise.resolve(answerIn(...request.targets.views));
  };
  undo.push(replace(segmentation, { segmentViews, proposeScales: async () => ({ proposals: [] }) }));
  const { session, answer } = await fakeSession();
  session.addPoint({ view: 'a.jpg' }, { x: 0.5, y: 0.5, negative: false });
  answer('a.jpg');
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(scales.splice(0)).toEqual([undefined, undefined]);
  const box = { x: 0, y: 0, width: 1, height: 1 };
  session.pose({ kind: 'box', place: { view: 'a.jpg' }, box });
  answer('a.jpg');
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(scales).toEqual([0.4, 0.4]);
  session.end();
});

test('views that cannot be answered end the search with the failure', async () => {
  const { segmentation } = await import('../../app/api/clients');
  const segmentViews = () => Promise.reject(new ConnectError('too large', Code.ResourceExhausted));
  undo.push(replace(segmentation, { segmentViews, proposeScales: async () => ({ proposals: [] }) }));
  const { session, answer } = await fakeSession();
  session.addPoint({ view: 'a.jpg' }, { x: 0.5, y: 0.5, negative: false });
  answer('a.jpg');
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(session.state.get().failure?.what).toBe('Too large.');
  session.end();
});

test('in a label’s own view the accepted mask is the answer, until the scale changes', async () => {
  const { labels, segmentation } = await import('../../app/api/clients');
  const getLabel = async () => ({
    view: 'b.jpg',
    mask: { image: { case: 'rle', value: firstRow } },
  });
  const segmentViews = async ({ targets }: { targets: { views: string[] } }) =>
    answerIn(...targets.views);
  undo.push(replace(labels, { getLabel }), replace(segmentation, { segmentViews }));
  const { session, answer } = await fakeSession();
  const own = () => session.state.get().answer?.masks.get('b.jpg');
  session.show('b.jpg');
  session.pose({ kind: 'label', label: 'scenes/shelf/labels/cup' });
  answer('b.jpg'); // the model's mask
  await expect.poll(() => own()?.rle).toEqual(firstRow);
  expect(own()).toMatchObject({ area: 2, box: [0, 0, 2, 1] });
  await expect.poll(() => session.state.get().looking).toBe(false);
  expect(session.state.get().answer?.masks.size).toBe(5);
  expect(own()?.rle).toEqual(firstRow);
  session.drag({ scale: 0.9 });
  answer('b.jpg');
  expect(own()?.rle).toEqual(maskIn('b.jpg').mask.value);
  session.end();
});

test('without the view of a label in the live model, its masks are the model’s', async () => {
  const { labels } = await import('../../app/api/clients');
  const { acceptedMask } = await import('../../app/scene/accepted_mask');
  const refuse = (code: Code) => () => Promise.reject(new ConnectError('refused', code));
  undo.push(replace(labels, { getLabel: refuse(Code.FailedPrecondition) }));
  const { signal } = new AbortController();
  expect(await acceptedMask('scenes/shelf/labels/cup', signal)).toBeUndefined();
  undo.push(replace(labels, { getLabel: refuse(Code.NotFound) }));
  await expect(acceptedMask('scenes/shelf/labels/cup', signal)).rejects.toThrow();
});

test('SAM is offered only by a server that has it', async () => {
  const { segmentation } = await import('../../app/api/clients');
  const { serverHasSam } = await import('../../app/scene/server_sam');
  const { signal } = new AbortController();
  const asked: object[] = [];
  const refuse = (reason: string) => (request: object) => {
    asked.push(request);
    return Promise.reject(errorWith(Code.FailedPrecondition, 'refused', { reason }));
  };
  undo.push(replace(segmentation, { segmentViews: refuse('NO_SAM') }));
  expect(await serverHasSam(model, signal)).toBe(false);
  undo.push(replace(segmentation, { segmentViews: refuse('BAD_FIELD') }));
  expect(await serverHasSam(model, signal)).toBe(true);
  expect(asked[0]).toEqual({ model, samBorders: true });
});

test('an error about SAM is in words for annotators', async () => {
  const { failureOf } = await import('../../app/api/failure');
  const message = 'this server has no SAM (deploy/sam.sh); leave sam_borders and sam_clicks out';
  const { what, todo } = failureOf(
    errorWith(Code.FailedPrecondition, message, { reason: 'NO_SAM', resource: 'sam' }),
  );
  expect(what).toBe('This server cannot place borders by SAM.');
  expect(todo).not.toContain('deploy/');
});
