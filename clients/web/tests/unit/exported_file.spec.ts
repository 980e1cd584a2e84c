// Files of Gaussians and meshes that the back end passes on.
import { createHash } from 'node:crypto';
import { createServer } from 'node:http';
import type { IncomingMessage, Server, ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { expect, test } from '@playwright/test';
import { getMesh } from '../../server/mesh';
import { getPly } from '../../server/ply';
import { MeshFormat } from '../../gen/pepeseg/v1/render_service_pb';

const bytes = Buffer.alloc(3000, 'pepeseg');
const sha256 = createHash('sha256').update(bytes).digest('hex');

type Route = (
  backEnd: never,
  request: IncomingMessage,
  response: ServerResponse,
) => Promise<void>;

let server: Server | undefined;
test.afterEach(() => {
  server?.closeAllConnections();
  server?.close();
});

/** Answers a query by a call that sends the bytes in chunks, and says that they have this digest. */
async function answerTo(route: Route, query: string, digest = sha256, chunk = 1000) {
  const asked: unknown[] = [];
  const stream = async function* (request: unknown) {
    asked.push(request);
    yield { part: { case: 'header', value: { numBytes: 3000n, sha256: digest } } };
    for (let at = 0; at < bytes.length; at += chunk) {
      yield { part: { case: 'chunk', value: bytes.subarray(at, at + chunk) } };
    }
  };
  const backEnd = { channel: { rendering: { exportGaussians: stream, exportMesh: stream } } };
  const listening = createServer((...pair) => void route(backEnd as never, ...pair));
  server = listening;
  await new Promise<void>((done) => listening.listen(0, '127.0.0.1', done));
  const { port } = listening.address() as AddressInfo;
  const answer = await fetch(`http://127.0.0.1:${port}/?${query}`).catch(() => undefined);
  const body = await answer?.arrayBuffer().catch(() => undefined);
  return { asked, answer, body: body && Buffer.from(body) };
}

test('Gaussians and meshes come whole', async () => {
  const ply = await answerTo(getPly, 'model=scenes/a/models/1&segment=3&level=2&complement=1');
  expect(Buffer.compare(ply.body as Buffer, bytes)).toBe(0);
  expect(ply.asked[0]).toMatchObject({
    model: 'scenes/a/models/1',
    subset: { of: { case: 'segment', value: { id: 3, level: 2 } }, complement: true },
  });
  const mesh = await answerTo(
    getMesh,
    `model=scenes/a/models/1&selection=s&format=${MeshFormat.GLB}&watertight=1`,
  );
  expect(Buffer.compare(mesh.body as Buffer, bytes)).toBe(0);
  expect(mesh.answer?.headers.get('content-length')).toBe('3000');
  expect(mesh.asked[0]).toMatchObject({
    model: 'scenes/a/models/1',
    format: MeshFormat.GLB,
    watertight: true,
    subset: { of: { case: 'selection', value: 's' } },
  });
  const scene = await answerTo(getMesh, 'model=scenes/a/models/1');
  expect(scene.asked[0]).toEqual({
    model: 'scenes/a/models/1',
    format: MeshFormat.PLY,
    watertight: false,
  });
});

test('a damaged file is cut off, or an error if nothing of it was sent', async () => {
  const wrong = 'f'.repeat(64);
  expect((await answerTo(getMesh, 'model=m', wrong)).body).toBeUndefined();
  server?.close();
  const small = await answerTo(getMesh, 'model=m', wrong, bytes.length);
  expect(small.answer?.ok).toBe(false);
  expect(small.body?.toString()).toContain('damaged on the way');
});

test('a query without a model is refused', async () => {
  const { answer, body, asked } = await answerTo(getMesh, 'watertight=1');
  expect(answer?.status).toBe(400);
  expect(body?.toString()).toContain('model is missing');
  expect(asked).toEqual([]);
});
