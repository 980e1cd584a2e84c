// What a queued job waits for.
import { create } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import type { Job } from '../../gen/pepeseg/v1/job_service_pb';
import {
  JobSchema,
  JobState,
  Job_WaitSchema,
  Job_Wait_Reason,
} from '../../gen/pepeseg/v1/job_service_pb';
import { replace } from './fake_session';

test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

function waitFor(reason: Job_Wait_Reason, jobsAhead = 0, retrySeconds = 0n) {
  const retryTime = { seconds: retrySeconds, nanos: 0 };
  return create(Job_WaitSchema, { reason, jobsAhead, retryTime });
}

test('a wait is said in words', async () => {
  const { waitText } = await import('../../app/training/queue_wait');
  const said = (...wait: Parameters<typeof waitFor>) => waitText(waitFor(...wait), 1000);
  expect(said(Job_Wait_Reason.DEVICE)).toBe('Next, when a device is free');
  expect(said(Job_Wait_Reason.DEVICE, 1)).toBe('After 1 other, when a device is free');
  expect(said(Job_Wait_Reason.DEVICE, 3)).toBe('After 3 others, when a device is free');
  expect(said(Job_Wait_Reason.QUOTA)).toContain('by its quota');
  expect(said(Job_Wait_Reason.RETRY, 0, 1090n)).toBe('1 min 30 s until the next attempt');
  const unknown = 'Waiting for other trainings to end';
  expect(said(99 as Job_Wait_Reason)).toBe(unknown);
  expect(waitText(undefined, 0)).toBe(unknown);
});

test('the wait is asked for until the job is no longer queued', async () => {
  const { jobs } = await import('../../app/api/clients');
  const { followWait } = await import('../../app/training/queue_wait');
  const answers: Job[] = [2, 1, 0].map((ahead) =>
    create(JobSchema, { state: JobState.QUEUED, wait: waitFor(Job_Wait_Reason.DEVICE, ahead) }),
  );
  answers.push(create(JobSchema, { state: JobState.RUNNING }));
  const asked: string[] = [];
  const getJob = async ({ name }: { name: string }) => answers[asked.push(name) - 1];
  const back = replace(jobs, { getJob });
  const ahead: (number | undefined)[] = [];
  await followWait('jobs/j3', new AbortController().signal, (wait) => ahead.push(wait?.jobsAhead), 1);
  back();
  expect(ahead).toEqual([2, 1, 0]);
  expect(asked).toEqual(Array(4).fill('jobs/j3'));
});

test('after the screen is left nothing is asked', async () => {
  const { jobs } = await import('../../app/api/clients');
  const { followWait } = await import('../../app/training/queue_wait');
  let numAsked = 0;
  const back = replace(jobs, { getJob: async () => (numAsked += 1) });
  const controller = new AbortController();
  const followed = followWait('jobs/j3', controller.signal, () => undefined, 5);
  controller.abort();
  await followed;
  back();
  expect(numAsked).toBe(0);
});
