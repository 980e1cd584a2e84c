// Browsers that leave during a request: nothing of theirs stays open in the back end.
import { mkdirSync, mkdtempSync, readdirSync, readlinkSync, rmSync, writeFileSync } from 'node:fs';
import type { ClientRequest, Server } from 'node:http';
import { get, request } from 'node:http';
import type { AddressInfo } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { Code, ConnectError, createClient } from '@connectrpc/connect';
import { createConnectTransport } from '@connectrpc/connect-node';
import { expect, test } from '@playwright/test';
import { EditService } from '../../gen/pepeseg/v1/edit_service_pb';
import type { BackEnd } from '../../server/back_end';
import type { Config } from '../../server/config';
import { createWebServer } from '../../server/web_server';

/** More bytes than the sockets on the way buffer. */
const manyBytes = 64 << 20;
let folder: string;
let server: Server;
/** What the server behind the back end sees. */
let upstream: { calls: number; open: number; cancelled: number };

function whenAborted(signal: AbortSignal): Promise<never> {
  return new Promise((_, reject) => {
    const fail = () => {
      upstream.cancelled += 1;
      reject(new ConnectError('cancelled', Code.Canceled));
    };
    if (signal.aborted) fail();
    signal.addEventListener('abort', fail);
  });
}

async function* endlessPly(_: unknown, { signal }: { signal: AbortSignal }) {
  upstream.open += 1;
  const gone = whenAborted(signal);
  gone.catch(() => undefined);
  const data = new Uint8Array(1 << 20);
  try {
    yield { part: { case: 'header', value: { numBytes: 1n << 40n, sha256: '', numGaussians: 1n } } };
    for (;;) {
      await Promise.race([gone, new Promise((resolve) => setTimeout(resolve, 1))]);
      yield { part: { case: 'chunk', value: data } };
    }
  } finally {
    upstream.open -= 1;
  }
}

async function* endlessEdit(_: unknown, { signal }: { signal: AbortSignal }) {
  upstream.open += 1;
  try {
    yield { part: { case: 'progress', value: { activity: 'looking', numDone: 1n, numAll: 2n } } };
    await whenAborted(signal);
  } finally {
    upstream.open -= 1;
  }
}

async function* endlessPhotograph(_: unknown, { signal }: { signal: AbortSignal }) {
  upstream.open += 1;
  const gone = whenAborted(signal);
  gone.catch(() => undefined);
  const data = new Uint8Array(1 << 20);
  try {
    yield { part: { case: 'header', value: { numBytes: 1n << 40n, contentType: 'image/jpeg' } } };
    for (;;) {
      await Promise.race([gone, new Promise((resolve) => setTimeout(resolve, 1))]);
      yield { part: { case: 'chunk', value: data } };
    }
  } finally {
    upstream.open -= 1;
  }
}

async function takeFile(messages: AsyncIterable<unknown>, { signal }: { signal: AbortSignal }) {
  upstream.open += 1;
  const take = async () => {
    for await (const message of messages) void message;
  };
  try {
    await Promise.race([whenAborted(signal), take()]);
  } finally {
    upstream.open -= 1;
  }
  return {};
}

test.beforeEach(async () => {
  folder = mkdtempSync(join(tmpdir(), 'leaving-'));
  upstream = { calls: 0, open: 0, cancelled: 0 };
  const slow = async (_: unknown, { signal }: { signal: AbortSignal }) => {
    upstream.calls += 1;
    await whenAborted(signal);
  };
  const channel = {
    scenes: { getScene: async () => ({}) },
    datasets: { writeFiles: takeFile, getPhotograph: endlessPhotograph },
    jobs: {},
    segmentation: {},
    labels: {},
    selections: {},
    editing: { editModel: endlessEdit },
    rendering: { exportGaussians: endlessPly, renderView: slow },
  };
  const backEnd = { channel };
  server = createWebServer(
    { hosts: new Set(['127.0.0.1']), appFolder: join(folder, 'app') } as unknown as Config,
    backEnd as unknown as BackEnd,
  );
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
});

test.afterEach(() => {
  server.closeAllConnections();
  server.close();
  rmSync(folder, { recursive: true });
});

function url(path: string): string {
  return `http://127.0.0.1:${(server.address() as AddressInfo).port}${path}`;
}

/** Returns the files of the test's folder that this process, which runs the back end, has open. */
function openFiles(): string[] {
  const names: string[] = [];
  for (const fd of readdirSync('/proc/self/fd')) {
    try {
      names.push(readlinkSync(`/proc/self/fd/${fd}`));
    } catch {
      // The descriptor of this readdir itself.
    }
  }
  return names.filter((name) => name.startsWith(folder));
}

/** Reads a few bytes and leaves. */
async function leaveDuring(path: string): Promise<void> {
  await new Promise<void>((resolve, reject) => {
    const asking = get(url(path), (response) => {
      expect(response.statusCode).toBe(200);
      response.once('data', () => {
        response.pause();
        setTimeout(() => {
          expect(openFiles().length + upstream.open).toBeGreaterThan(0);
          asking.destroy();
          resolve();
        }, 50);
      });
    });
    asking.on('error', reject);
  });
}

test('fetching a photograph stops when its reader leaves', async () => {
  await leaveDuring('/api/photo?parent=scenes/shelf/models/1&name=1.jpg');
  await expect.poll(() => upstream.open).toBe(0);
  expect(upstream.cancelled).toBe(1);
});

test('a file of the app is closed when its reader leaves', async () => {
  mkdirSync(join(folder, 'app', 'assets'), { recursive: true });
  writeFileSync(join(folder, 'app', 'assets', 'a.js'), new Uint8Array(manyBytes));
  await leaveDuring('/assets/a.js');
  await expect.poll(openFiles).toEqual([]);
});

test('exporting a PLY stops when its reader leaves', async () => {
  const warnings: string[] = [];
  const warn = (warning: Error) => warnings.push(warning.name);
  process.on('warning', warn);
  await leaveDuring('/api/ply?model=scenes/shelf/models/1');
  await expect.poll(() => upstream.open).toBe(0);
  expect(upstream.cancelled).toBe(1);
  process.off('warning', warn);
  expect(warnings).toEqual([]);
});

test('rendering a picture stops when nobody waits for it', async () => {
  const asking = get(url('/api/picture?model=scenes/shelf/models/1&view=1.jpg'));
  asking.on('error', () => undefined);
  await expect.poll(() => upstream.calls).toBe(1);
  asking.destroy();
  await expect.poll(() => upstream.cancelled).toBe(1);
});

test('an edit is cancelled when its reader leaves', async () => {
  const transport = createConnectTransport({
    baseUrl: url('/api/rpc'),
    useBinaryFormat: true,
    httpVersion: '1.1',
  });
  const leaving = new AbortController();
  const { signal } = leaving;
  const activities: string[] = [];
  const editing = async () => {
    const client = createClient(EditService, transport);
    for await (const { part } of client.editModel({ model: 'scenes/a/models/1' }, { signal })) {
      if (part.case !== 'progress') continue;
      activities.push(part.value.activity);
      expect(upstream.open).toBe(1);
      leaving.abort();
    }
  };
  await expect(editing()).rejects.toThrow();
  expect(activities).toEqual(['looking']);
  await expect.poll(() => upstream).toMatchObject({ open: 0, cancelled: 1 });
});

test('an interrupted upload is cancelled', async () => {
  const path = '/api/file?upload=scenes/shelf/uploads/1&path=images/1.jpg&offset=0';
  const sending: ClientRequest = request(url(path), {
    method: 'PUT',
    headers: { 'content-length': String(manyBytes) },
  });
  sending.on('error', () => undefined);
  sending.write(new Uint8Array(3 << 20));
  await expect.poll(() => upstream.open).toBe(1);
  sending.destroy();
  await expect.poll(() => upstream.open).toBe(0);
});
