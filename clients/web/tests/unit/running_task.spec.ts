import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';

test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

test('an export shows its steps, and ends when it is cancelled', async () => {
  const { RunningTask } = await import('../../app/scene/running_task');
  const exporting = new RunningTask();
  let go: () => void = () => undefined;
  const reached: number[] = [];
  const running = exporting.run(async (steps) => {
    const { progress } = steps('Segmenting', 'masks');
    for (let done = 0; done < 3; ++done) {
      progress(done, 3);
      reached.push(done);
      await new Promise<void>((resolve) => (go = resolve));
    }
  });
  expect(exporting.state.get().step).toEqual({
    name: 'Segmenting',
    unit: 'masks',
    done: 0,
    total: 3,
  });
  go();
  await expect.poll(() => exporting.state.get().step?.done).toBe(1);
  exporting.cancel();
  expect(exporting.state.get()).toEqual({ step: undefined, failure: undefined });
  go();
  await running;
  expect(reached).toEqual([0, 1]);
  expect(exporting.state.get()).toEqual({ step: undefined, failure: undefined });
});

test('an export that fails says why, and the next one begins', async () => {
  const { RunningTask } = await import('../../app/scene/running_task');
  const exporting = new RunningTask();
  await exporting.run(() => Promise.reject(new ConnectError('the disk is full', Code.Internal)));
  expect(exporting.state.get().failure?.what).toBe('The disk is full.');
  await exporting.run(async () => undefined);
  expect(exporting.state.get()).toEqual({ step: undefined, failure: undefined });
});
