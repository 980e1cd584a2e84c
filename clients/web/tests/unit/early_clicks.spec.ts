// A job that is asked for clicks while it trains.
import type { MessageInitShape } from '@bufbuild/protobuf';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { errorWith } from '../../contract/error_detail';
import {
  JobEventSchema,
  JobProgressSchema,
  JobSchema,
  JobStage,
  JobState,
} from '../../gen/pepeseg/v1/job_service_pb';
import { isJob } from '../../app/scene/subject';
import { jobTimeLeft, stageText, stepText, timeLeftText } from '../../app/training/time_left';
import { fakeSession } from './fake_session';

test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

function early(retryMs?: number): ConnectError {
  return errorWith(Code.Unavailable, 'jobs/j3 is in stage prepare', {
    reason: 'NO_SNAPSHOT',
    ...(retryMs !== undefined && { retryMs }),
  });
}

test('a job without a state is not a server that is away', async () => {
  const { failureOf } = await import('../../app/api/failure');
  const failure = failureOf(early());
  expect([failure.isEarly, failure.away, failure.retryMs]).toEqual([true, false, 1000]);
  const away = failureOf(errorWith(Code.Unavailable, 'stops', { reason: 'DRAINING', retryMs: 5 }));
  expect([away.isEarly, away.away, away.retryMs]).toEqual([false, true, 5]);
});

test('calls to a job without a state are repeated, without a banner', async () => {
  const { serverLink, steadily } = await import('../../app/api/server_link');
  let numCalls = 0;
  const links: boolean[] = [];
  const answer = await steadily(async () => {
    links.push(serverLink.get().away);
    if (++numCalls < 3) throw early(5);
    return 'answer';
  });
  expect(answer).toBe('answer');
  expect(links).toEqual([false, false, false]);
});

test('a click that came too early is asked again, unless it was taken back', async () => {
  const { session, asked, answer, refuse } = await fakeSession();
  const click = () => session.addPoint({ view: 'a.jpg' }, { x: 1, y: 1, negative: false });
  click();
  refuse(early(20));
  const { busy, failure } = session.state.get();
  expect([busy, failure, asked.length]).toEqual([true, undefined, 1]);
  await expect.poll(() => asked.length).toBe(2);
  answer('a.jpg');
  expect(session.state.get().answer?.masks.get('a.jpg')?.area).toBe(1);
  session.clear();
  click();
  refuse(early(20));
  session.clear();
  await new Promise((wake) => setTimeout(wake, 60));
  expect(asked.length).toBe(3);
  session.end();
});

test('a job is asked at most every two seconds, one request at a time, until it answers', async () => {
  const { SnapshotProbe } = await import('../../app/training/snapshot_probe');
  let numFound = 0;
  let numAsked = 0;
  let end: (answers: boolean) => void = () => undefined;
  const ask = () => {
    numAsked += 1;
    return new Promise<void>((resolve, reject) => {
      end = (answers) => (answers ? resolve() : reject(early()));
    });
  };
  const probe = new SnapshotProbe(ask, () => (numFound += 1));
  const first = probe.look(0);
  void probe.look(5000);
  expect(numAsked).toBe(1);
  end(false);
  await first;
  void probe.look(1999);
  expect(numAsked).toBe(1);
  const second = probe.look(2000);
  expect(numAsked).toBe(2);
  end(true);
  await second;
  void probe.look(9000);
  expect([numAsked, numFound]).toEqual([2, 1]);

  const left = new SnapshotProbe(ask, () => (numFound += 1));
  const last = left.look(0);
  left.end();
  end(true);
  await last;
  expect(numFound, 'nobody waits any longer').toBe(1);
});

test('only a running job that trains Gaussians, or is further on, is asked', async () => {
  const { mayAnswer } = await import('../../app/training/snapshot_probe');
  const { noTraining } = await import('../../app/training/training_watch');
  const asked = (state: JobState, stage: JobStage) =>
    mayAnswer({ ...noTraining, job: create(JobSchema, { state, stage }) });
  expect(mayAnswer(noTraining)).toBe(false);
  expect(asked(JobState.RUNNING, JobStage.SFM)).toBe(false);
  expect(asked(JobState.RUNNING, JobStage.RECONSTRUCT)).toBe(true);
  expect(asked(JobState.RUNNING, JobStage.FEATURES)).toBe(true);
  expect(asked(JobState.QUEUED, JobStage.FEATURES)).toBe(false);
  expect(asked(JobState.FAILED, JobStage.FEATURES)).toBe(false);
  expect([isJob('jobs/j3'), isJob('scenes/jobs/models/1')]).toEqual([true, false]);
});

test('the time left is that of the job, from the first answer on', async () => {
  const { after, noTraining } = await import('../../app/training/training_watch');
  const progress = create(JobProgressSchema, { jobEta: { seconds: 41n, nanos: 0 } });
  const event = { case: 'snapshot', value: create(JobSchema, { progress }) } as const;
  const training = after(noTraining, create(JobEventSchema, { event }));
  expect(jobTimeLeft(training.progress)).toBe('about 40 s left');
  expect(jobTimeLeft(undefined)).toBe('time left not known yet');
  expect([3, 52, 91, 3500, 3700, 8000].map(timeLeftText)).toEqual([
    'a few seconds left',
    'about 50 s left',
    'about 2 min left',
    'about 58 min left',
    'about 1 h left',
    'about 2 h 10 min left',
  ]);
});

test('a stage has its number, and says what it counts', () => {
  const at = (fields: MessageInitShape<typeof JobProgressSchema>) =>
    create(JobProgressSchema, { step: 19n, numSteps: 1060n, stage: JobStage.SFM, ...fields });
  expect(stepText(at({}))).toBe('step 19 of 1,060');
  expect(stepText(at({ activity: 'matching', unit: 'pairs' }))).toBe('matching 19 of 1,060 pairs');
  expect(stageText(at({}))).toBe('Poses');
  expect(stageText(at({ stageNumber: 2, numStages: 5 }))).toBe('Poses, stage 2 of 5');
});
