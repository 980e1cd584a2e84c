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
  const { isMiss } = await import('../../app/scene/miss');
  const { failureOf } = await import('../../app/api/failure');
  expect(isMiss(failureOf(refusal('NOTHING_THERE')))).toBe(true);
  expect(isMiss(failureOf(refusal('BAD_FIELD')))).toBe(false);
  expect(isMiss(failureOf(new ConnectError('a bad scale', Code.InvalidArgument)))).toBe(false);
});

test('a click on nothing keeps the answer before it, and marks its position', async () => {
  const { SceneSession } = await import('../../app/scene/session');
  const session = new SceneSession('scenes/shelf/models/1', ['a.jpg']);
  // Without a network: the answers are given by hand.
  const inside = session as unknown as {
    socket: { ask: () => bigint };
    take: (sequence: bigint, response: object) => void;
    refused: (sequence: bigint, error: unknown) => void;
    others: object;
  };
  let sequence = 0n;
  inside.socket = { ask: () => ++sequence, close: () => undefined } as never;
  inside.others = { ask: () => undefined, stop: () => undefined };
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
  // Until the answer comes, the mask so far is shown.
  const { answer: shown, busy: waits, current } = session.state.get();
  expect([shown, waits, current.size]).toEqual([before.answer, true, 0]);
  inside.refused(sequence, refusal('NOTHING_THERE'));
  const after = session.state.get();
  expect(after.miss).toEqual({ place, x: 3, y: 2 });
  expect(after.prompt).toEqual(before.prompt);
  expect(after.answer).toBe(before.answer);
  expect([after.busy, after.failure, session.history.state.get().undo]).toEqual([
    false,
    undefined,
    'Click',
  ]);
  await session.history.undo();
  expect(session.state.get().prompt).toBeUndefined();
});

test('SAM places the border of the shown mask until the prompt changes', async () => {
  const { SceneSession } = await import('../../app/scene/session');
  const { segmentation } = await import('../../app/api/clients');
  const session = new SceneSession('scenes/shelf/models/1', ['a.jpg']);
  const inside = session as unknown as {
    socket: object;
    take: (sequence: bigint, response: object) => void;
    others: object;
  };
  let sequence = 0n;
  inside.socket = { ask: () => ++sequence, close: () => undefined };
  inside.others = { ask: () => undefined, stop: () => undefined };
  const answer = (area: bigint) => ({
    masks: [
      {
        view: 'a.jpg',
        mask: { case: 'rle', value: { width: 4, height: 3, counts: '0<' } },
        area,
        score: 1,
      },
    ],
    scaleQuantile: 0.4,
    scaleUnits: 1,
    threshold: 0.7,
  });
  const asked: { samBorders?: boolean; targets?: { views: string[] } }[] = [];
  let reply: Promise<object> = Promise.resolve(answer(11n));
  const before = segmentation.segmentViews;
  segmentation.segmentViews = ((request: object) => {
    asked.push(request);
    return reply;
  }) as never;
  try {
    session.show('a.jpg');
    session.addPoint({ view: 'a.jpg' }, { x: 1, y: 1, negative: false });
    await session.placeBorder();
    expect(asked).toHaveLength(0); // there is no answer yet
    inside.take(sequence, answer(12n));
    await session.placeBorder();
    expect(asked[0]).toMatchObject({ samBorders: true, targets: { views: ['a.jpg'] } });
    const { answer: placed, busy } = session.state.get();
    expect([placed?.masks.get('a.jpg')?.area, busy]).toEqual([11, false]);

    // A server without SAM: the mask stays.
    reply = Promise.reject(errorWith(Code.FailedPrecondition, 'no SAM', { reason: 'NO_SAM' }));
    await session.placeBorder();
    const refused = session.state.get();
    expect([refused.failure?.reason, refused.busy]).toEqual(['NO_SAM', false]);
    expect(refused.answer?.masks.get('a.jpg')?.area).toBe(11);

    // A new click wins over an answer that comes later.
    let comes: (response: object) => void = () => undefined;
    reply = new Promise((resolve) => {
      comes = resolve;
    });
    const placing = session.placeBorder();
    session.addPoint({ view: 'a.jpg' }, { x: 2, y: 1, negative: false });
    comes(answer(10n));
    await placing;
    const { answer: shown, busy: waits } = session.state.get();
    expect([shown?.masks.get('a.jpg')?.area, waits]).toEqual([11, true]);
  } finally {
    segmentation.segmentViews = before;
  }
});

test('a first click on nothing leaves nothing', async () => {
  const { SceneSession } = await import('../../app/scene/session');
  const session = new SceneSession('scenes/shelf/models/1', ['a.jpg']);
  const inside = session as unknown as {
    socket: object;
    refused: (sequence: bigint, error: unknown) => void;
    others: object;
  };
  inside.socket = { ask: () => 1n, close: () => undefined };
  inside.others = { ask: () => undefined, stop: () => undefined };
  session.addPoint({ view: 'a.jpg' }, { x: 3, y: 2, negative: false });
  inside.refused(1n, refusal('NOTHING_THERE'));
  const { prompt, answer, busy, failure, miss } = session.state.get();
  expect([prompt, answer, busy, failure]).toEqual([undefined, undefined, false, undefined]);
  expect(session.history.state.get().undo).toBeUndefined();
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
