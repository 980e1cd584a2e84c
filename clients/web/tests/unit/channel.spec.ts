import type { UnaryRequest } from '@connectrpc/connect';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { errorWith } from '../../contract/error_detail';
import { retryAsTold } from '../../server/channel';

function putOff(reason: string, retryMs = 10, code = Code.Unavailable): ConnectError {
  return errorWith(code, 'not now', { reason, retryMs });
}

/** Calls a server that first answers with `errors`. */
async function ask(errors: ConnectError[], signal = new AbortController().signal) {
  let calls = 0;
  const next = async () => {
    const error = errors[calls++];
    if (error) throw error;
    return 'answer';
  };
  const request = { stream: false, signal } as unknown as UnaryRequest;
  const answer = await retryAsTold(next as never)(request).catch((error: unknown) => error);
  return { calls, answer };
}

test('a refused call is repeated', async () => {
  const { calls, answer } = await ask([putOff('NO_ROOM_NOW'), putOff('BUSY')]);
  expect(calls).toBe(3);
  expect(answer).toBe('answer');
});

test('a call is not repeated if waiting does not help', async () => {
  const useless = [
    putOff('DRAINING'),
    putOff('NO_SNAPSHOT'),
    putOff('QUOTA', 0.001, Code.ResourceExhausted),
    new ConnectError('connect ECONNREFUSED', Code.Unavailable),
  ];
  for (const error of useless) expect(await ask([error])).toEqual({ calls: 1, answer: error });
});

test('a call is not repeated when nobody waits for it', async () => {
  const controller = new AbortController();
  setTimeout(() => controller.abort(), 20);
  const { calls, answer } = await ask([putOff('BUSY', 999)], controller.signal);
  expect(calls).toBe(1);
  expect(answer).toBeInstanceOf(Error);
});
