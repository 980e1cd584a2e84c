// Files that the page fetches from a back end, which a test plays.
import type { RequestListener, Server } from 'node:http';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';

let server: Server | undefined;

async function urlOf(answer: RequestListener): Promise<string> {
  const listening = createServer(answer);
  server = listening;
  await new Promise<void>((resolve) => listening.listen(0, '127.0.0.1', resolve));
  return `http://127.0.0.1:${(listening.address() as AddressInfo).port}/api/ply?model=m`;
}

test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
  server?.closeAllConnections();
  server?.close();
});

/** Fetches, and returns the file, or the error, with the steps that were reported. */
async function fetched(url: string, signal = new AbortController().signal) {
  const { fetchFile } = await import('../../app/api/fetch_file');
  const steps: [number, number][] = [];
  const progress = (done: number, total: number) => void steps.push([done, total]);
  try {
    return { steps, file: await fetchFile(url, { progress, signal }), error: undefined };
  } catch (error) {
    return { steps, file: undefined, error };
  }
}

test('a file comes whole, and its bytes are counted as they come', async () => {
  // More than one piece, whose bytes differ.
  const bytes = Buffer.alloc(40 << 20, 'pepeseg');
  const url = await urlOf((_, response) => {
    response.writeHead(200, { 'content-length': String(bytes.length) });
    response.end(bytes);
  });
  const { steps, file } = await fetched(url);
  expect(Buffer.compare(Buffer.from(await (file as Blob).arrayBuffer()), bytes)).toBe(0);
  expect(steps.slice(0, 2)).toEqual([
    [0, 0],
    [0, bytes.length],
  ]);
  expect(steps.at(-1)).toEqual([bytes.length, bytes.length]);
  expect(steps.length).toBeGreaterThan(10);
  const counts = steps.map(([done]) => done);
  expect(counts).toEqual([...counts].sort((a, b) => a - b));
});

test('a file of unknown size has no total', async () => {
  const url = await urlOf((_, response) => {
    response.write('ply');
    response.end('ply');
  });
  const { steps, file } = await fetched(url);
  expect(await file?.text()).toBe('plyply');
  expect(steps.at(-1)).toEqual([6, 0]);
});

test('a file that is cut off is an error, not a shorter file', async () => {
  const url = await urlOf((_, response) => {
    response.writeHead(200, { 'content-length': '1000' });
    response.write(Buffer.alloc(600));
    setTimeout(() => response.destroy(), 50);
  });
  const { file, error } = await fetched(url);
  expect(file).toBeUndefined();
  expect(ConnectError.from(error).code).toBe(Code.DataLoss);
  expect(ConnectError.from(error).rawMessage).toContain('cut off after 600 bytes');
});

test('an error of the back end is what the person reads', async () => {
  const url = await urlOf((_, response) => {
    response.writeHead(404, { 'content-type': 'application/json' });
    response.end(JSON.stringify({ code: Code.NotFound, message: 'there is no such model' }));
  });
  const { error } = await fetched(url);
  expect(ConnectError.from(error).code).toBe(Code.NotFound);
  expect(ConnectError.from(error).rawMessage).toBe('there is no such model');
});

test('a server that is away is asked again until it answers', async () => {
  let numCalls = 0;
  const url = await urlOf((_, response) => {
    numCalls += 1;
    if (numCalls === 1) {
      response.writeHead(503);
      response.end(JSON.stringify({ code: Code.Unavailable, message: 'restarting' }));
      return;
    }
    response.end('ply');
  });
  expect(await (await fetched(url)).file?.text()).toBe('ply');
  expect(numCalls).toBe(2);
});

test('a cancelled download ends the request', async () => {
  const controller = new AbortController();
  let closed = false;
  const url = await urlOf((_, response) => {
    response.writeHead(200, { 'content-length': '1000' });
    response.write(Buffer.alloc(600));
    response.on('close', () => (closed = true));
    setTimeout(() => controller.abort(), 50);
  });
  const { RunningTask } = await import('../../app/scene/running_task');
  const { file, error } = await fetched(url, controller.signal);
  expect(file).toBeUndefined();
  expect((error as DOMException).name).toBe('AbortError');
  await expect.poll(() => closed).toBe(true);
  // An export that ends so has no failure to show.
  const running = new RunningTask();
  await running.run(() => Promise.reject(error));
  expect(running.state.get().failure).toBeUndefined();
});
