import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { errorWith } from '../../contract/error_detail';
import { JobStage, JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { outcomeOf } from '../../app/training/job_states';

// The session listens to the page's network. axe-core, which other tests of this process import,
// takes a window for a browser's.
test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

function refusal(reason: string): ConnectError {
  return errorWith(Code.InvalidArgument, 'refused', { reason });
}

test('a click on nothing differs from other refusals', async () => {
  const { isMiss } = await import('../../app/scene/session');
  const { failureOf } = await import('../../app/api/failure');
  expect(isMiss(failureOf(refusal('NOTHING_THERE')))).toBe(true);
  expect(isMiss(failureOf(refusal('BAD_FIELD')))).toBe(false);
  expect(isMiss(failureOf(new ConnectError('a bad scale', Code.InvalidArgument)))).toBe(false);
});

test('a click on nothing keeps the answer before it, and marks its position', async () => {
  const { SceneSession } = await import('../../app/scene/session');
  const session = new SceneSession('scenes/shelf/models/1');
  // Without a network: the answers are given by hand.
  const inside = session as unknown as {
    socket: { ask: () => bigint };
    take: (sequence: bigint, response: object) => void;
    refused: (sequence: bigint, error: unknown) => void;
    askOtherViews: () => void;
  };
  let sequence = 0n;
  inside.socket = { ask: () => ++sequence, close: () => undefined } as never;
  inside.askOtherViews = () => undefined;
  const place = { view: 'a.jpg' };
  const rle = { width: 4, height: 3, counts: '0<' };
  const found = {
    masks: [{ view: 'a.jpg', mask: { case: 'rle', value: rle }, area: 12n, score: 1 }],
    scaleQuantile: 0.4,
    scaleUnits: 1,
    threshold: 0.7,
  };
  session.addPoint(place, { x: 1, y: 1, negative: false });
  expect(session.state.get().busy).toBe(true);
  inside.take(sequence, found);
  const before = session.state.get();
  session.addPoint(place, { x: 3, y: 2, negative: false });
  expect(session.state.get().answer).toBeUndefined();
  inside.refused(sequence, refusal('NOTHING_THERE'));
  const after = session.state.get();
  expect(after.miss).toEqual({ place, x: 3, y: 2 });
  expect(after.prompt).toEqual(before.prompt);
  expect(after.answer).toBe(before.answer);
  expect([after.busy, after.failure, after.canUndo]).toEqual([false, undefined, true]);
  session.undo();
  expect(session.state.get().prompt).toBeUndefined();
});

test('a first click on nothing leaves nothing', async () => {
  const { SceneSession } = await import('../../app/scene/session');
  const session = new SceneSession('scenes/shelf/models/1');
  const inside = session as unknown as {
    socket: object;
    refused: (sequence: bigint, error: unknown) => void;
    askOtherViews: () => void;
  };
  inside.socket = { ask: () => 1n, close: () => undefined };
  inside.askOtherViews = () => undefined;
  session.addPoint({ view: 'a.jpg' }, { x: 3, y: 2, negative: false });
  inside.refused(1n, refusal('NOTHING_THERE'));
  const { prompt, answer, busy, failure, canUndo, miss } = session.state.get();
  expect([prompt, answer, busy, failure, canUndo]).toEqual([
    undefined,
    undefined,
    false,
    undefined,
    false,
  ]);
  expect(miss).toMatchObject({ x: 3, y: 2 });
});

test('a failed training names its stage', () => {
  expect(outcomeOf({ state: JobState.FAILED, stage: JobStage.SFM })).toBe('failed in Poses');
  expect(outcomeOf({ state: JobState.CANCELLED, stage: JobStage.RECONSTRUCT })).toBe(
    'cancelled in Reconstruct',
  );
  expect(outcomeOf({ state: JobState.CANCELLED, stage: JobStage.UNSPECIFIED })).toBe('cancelled');
  expect(outcomeOf({ state: JobState.SUCCEEDED, stage: JobStage.INDEX })).toBe('done');
});
