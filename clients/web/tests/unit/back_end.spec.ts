import { accessSync, constants } from 'node:fs';
import type { IncomingMessage } from 'node:http';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import { ConfigError, readConfig } from '../../server/config';
import { refusal } from '../../server/guard';
import { Newest } from '../../server/segment_socket';
import { pieces } from '../../server/upload';
import { resourceOf } from '../../server/proxy';
import { passedOn } from '../../server/passed_on';
import { getPhoto, photographRequest } from '../../server/photo';
import { PixelFrame } from '../../gen/pepeseg/v1/prompt_pb';
import { cacheControl } from '../../server/answer';
import { routing } from '../../server/channel';
import { learnScenes } from '../../server/job_scenes';
import {
  JobEventSchema,
  JobSchema,
  ListJobsResponseSchema,
} from '../../gen/pepeseg/v1/job_service_pb';

function request(headers: Record<string, string>): IncomingMessage {
  return { headers } as unknown as IncomingMessage;
}

const hosts = new Set(['localhost', '127.0.0.1', '[::1]']);

test('requests of this back end’s pages are allowed', () => {
  expect(refusal(request({ host: '127.0.0.1:8080' }), hosts)).toBeUndefined();
  expect(refusal(request({ host: '[::1]:8080' }), hosts)).toBeUndefined();
  const own = {
    host: 'localhost:8080',
    origin: 'http://localhost:8080',
    'sec-fetch-site': 'same-origin',
  };
  expect(refusal(request(own), hosts)).toBeUndefined();
});

test('all other requests are refused', () => {
  const host = 'localhost:8080';
  expect(refusal(request({ host, origin: 'https://evil.example' }), hosts)).toContain('origins');
  expect(refusal(request({ host, origin: 'http://localhost:9999' }), hosts)).toContain('origins');
  expect(refusal(request({ host, origin: 'null' }), hosts)).toContain('origins');
  expect(refusal(request({ host, 'sec-fetch-site': 'cross-site' }), hosts)).toContain('sites');
  expect(refusal(request({ host, 'sec-fetch-site': 'same-site' }), hosts)).toContain('sites');
  expect(refusal(request({ host: 'evil.example:8080' }), hosts)).toContain('unknown host');
  expect(refusal(request({}), hosts)).toContain('unknown host');
});

test('options set the address, and the key is not sent unencrypted', () => {
  const read = (args: string[], env = {}) => readConfig(args, env, '/app');
  expect(read([]).serverUrl).toBe('http://127.0.0.1:50051');
  expect(read([], { PEPESEG_SERVER: 'https://gateway:8443' }).serverUrl).toBe(
    'https://gateway:8443',
  );
  expect(read([], { PEPESEG_KEY: 'pk_abc' }).key).toBe('pk_abc');
  expect(() => read(['--listen', '0.0.0.0:80'])).toThrow('--behind-login');
  expect(read(['--listen', '0.0.0.0:80', '--behind-login']).listenPort).toBe(80);
  expect(() => read(['--server', 'far.example:50051'], { PEPESEG_KEY: 'pk_abc' })).toThrow(
    'not encrypted',
  );
  expect(() => read([], { PEPESEG_KEY: 'no key' })).toThrow(ConfigError);
  expect(() => read(['--key-file', '/nowhere/key'])).toThrow('cannot be read');
  expect(() => read(['--nonsense'])).toThrow(ConfigError);
});

test('a body in pieces of a MiB', async () => {
  async function* body() {
    yield new Uint8Array(700_000).fill(1);
    yield new Uint8Array(3_000_000).fill(2);
    yield new Uint8Array(0);
  }
  const sizes: number[] = [];
  let sum = 0;
  for await (const piece of pieces(body())) {
    sizes.push(piece.length);
    for (const byte of piece) sum += byte;
  }
  expect(sizes).toEqual([1 << 20, 1 << 20, 1 << 20, 3_700_000 - 3 * (1 << 20)]);
  expect(sum).toBe(700_000 + 6_000_000);
});

test('only the newest of waiting requests is sent', async () => {
  const newest = new Newest<number>();
  newest.put(1);
  newest.put(2);
  const taken = newest[Symbol.asyncIterator]();
  expect((await taken.next()).value).toBe(2);
  const next = taken.next();
  newest.put(3);
  expect((await next).value).toBe(3);
  newest.end();
  expect((await taken.next()).done).toBe(true);
});

test('calls carry the scene for the gateway', () => {
  const message = (fields: object) => resourceOf({ $typeName: 'x', ...fields } as never);
  expect(routing(message({ name: 'scenes/a/models/1' }))).toEqual({ 'x-scene': 'a' });
  expect(routing(message({ scene: 'scenes/b', dataset: 'scenes/b/datasets/1' }))).toEqual({
    'x-scene': 'b',
  });
  expect(routing(message({ name: 'jobs/j1' }))).toEqual({});
});

test('a job’s calls are routed by its scene, once an answer has named that', () => {
  const scene = 'scenes/a';
  const headersOf = (model: string) => routing(resourceOf({ $typeName: 'x', model } as never));
  learnScenes(create(JobSchema, { name: 'jobs/seen', scene }));
  learnScenes(create(ListJobsResponseSchema, { jobs: [{ name: 'jobs/listed', scene }] }));
  const snapshot = { case: 'snapshot', value: create(JobSchema, { name: 'jobs/watched', scene }) } as const;
  learnScenes(create(JobEventSchema, { event: snapshot }));
  for (const job of ['seen', 'listed', 'watched']) {
    expect(headersOf(`jobs/${job}`)).toEqual({ 'x-scene': 'a' });
  }
  expect(headersOf('jobs/unseen')).toEqual({});
  // Old jobs are forgotten, from the oldest on.
  for (let i = 0; i < 999; ++i) learnScenes(create(JobSchema, { name: `jobs/n${i}`, scene }));
  expect(headersOf('jobs/listed')).toEqual({});
  expect(headersOf('jobs/watched')).toEqual({ 'x-scene': 'a' });
});

test('browsers keep what is made of a model, not of what changes', () => {
  expect(cacheControl('scenes/a/models/1')).toContain('immutable');
  expect(cacheControl('scenes/a/datasets/1')).toContain('immutable');
  expect(cacheControl('scenes/a/models/live')).toBe('no-store');
  expect(cacheControl('jobs/j1')).toBe('no-store');
});

test('a lost connection is not a cancellation', () => {
  const here = new AbortController();
  const cut = new ConnectError('http/2 stream closed with error code CANCEL (0x8)', Code.Canceled);
  expect(passedOn(cut, here.signal).code).toBe(Code.Unavailable);
  expect(passedOn(new ConnectError('no', Code.Internal), here.signal).code).toBe(Code.Internal);
  const busy = new ConnectError('a job is running', Code.Aborted);
  busy.details = [{ type: 'google.rpc.ErrorInfo', value: new Uint8Array() }];
  expect(passedOn(busy, here.signal).code).toBe(Code.Aborted);
  here.abort();
  expect(passedOn(cut, here.signal).code).toBe(Code.Canceled);
});

test('without a server the message names the address and an existing command', () => {
  const refused = new ConnectError('connect ECONNREFUSED 127.0.0.1:50077', Code.Unavailable);
  const told = passedOn(refused, new AbortController().signal);
  expect(told.code).toBe(Code.Unavailable);
  expect(told.rawMessage).toContain('the server does not answer. Nothing listens at 127.0.0.1:50077');
  const command = /`(\S+) --listen 127\.0\.0\.1:50077`/.exec(told.rawMessage)?.[1];
  if (command) accessSync(command, constants.X_OK);
  const far = new ConnectError('connect ECONNREFUSED 192.0.2.1:50051', Code.Unavailable);
  expect(passedOn(far, new AbortController().signal).rawMessage).not.toContain('start one');
});

test('a photograph is forwarded, and cut short where its stream fails', async () => {
  const data = new Uint8Array(3000).fill(7);
  const asked: unknown[] = [];
  const answer = (fails: boolean) => ({
    getPhotograph: async function* (request: unknown) {
      asked.push(request);
      yield { part: { case: 'header', value: { contentType: 'image/jpeg', numBytes: 3000n } } };
      yield { part: { case: 'chunk', value: data.subarray(0, 1000) } };
      if (fails) throw new ConnectError('damaged', Code.DataLoss);
      yield { part: { case: 'chunk', value: data.subarray(1000) } };
    },
  });
  const serve = async (fails: boolean) => {
    const backEnd = { channel: { datasets: answer(fails) } } as never;
    const server = createServer((request, response) => void getPhoto(backEnd, request, response));
    await new Promise<void>((done) => server.listen(0, '127.0.0.1', done));
    const { port } = server.address() as AddressInfo;
    const query = 'parent=scenes/a/models/1&name=b.jpg&max_side=256';
    const whole = await fetch(`http://127.0.0.1:${port}/api/photo?${query}`)
      .then(async (response) => new Uint8Array(await response.arrayBuffer()))
      .catch(() => undefined);
    server.close();
    return whole;
  };
  expect(await serve(false)).toEqual(data);
  expect(asked[0]).toMatchObject({
    parent: 'scenes/a/models/1',
    photograph: 'b.jpg',
    maxSide: 256,
    frame: PixelFrame.PHOTOGRAPH,
  });
  expect(await serve(true)).toBeUndefined();
});

test('other queries of photographs are refused', () => {
  const request = (query: string) => () => photographRequest(new URLSearchParams(query));
  expect(request('parent=scenes/a/datasets/1')()).toMatchObject({ photograph: '', maxSide: 0 });
  expect(request('parent=p&frame=view')().frame).toBe(PixelFrame.VIEW);
  expect(request('parent=p&frame=other')).toThrow('frame is unknown');
  expect(request('parent=p&max_side=-1')).toThrow('max_side');
  expect(request('name=a.jpg')).toThrow('parent is missing');
});
