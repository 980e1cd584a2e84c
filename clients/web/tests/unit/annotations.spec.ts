// The zip of annotations, from a server that a test plays.
import { createHash } from 'node:crypto';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import {
  AnnotationFormat,
  ExportAnnotationsResponseSchema,
} from '../../gen/pepeseg/v1/label_service_pb';
import { replace } from './fake_session';

type Part = { case: 'progress' | 'header' | 'chunk'; value: unknown };

const zip = Buffer.alloc(2_500_000, 'pepeseg');
const header = {
  numBytes: BigInt(zip.length),
  sha256: createHash('sha256').update(zip).digest('hex'),
};
const progress = (numMasksDone: bigint): Part => ({
  case: 'progress',
  value: { numMasksDone, numMasks: 45n },
});
const chunks = [0, 1 << 20, 2 << 20].map(
  (at): Part => ({ case: 'chunk', value: zip.subarray(at, at + (1 << 20)) }),
);
const whole: Part[] = [progress(12n), progress(45n), { case: 'header', value: header }, ...chunks];

let undo: (() => void) | undefined;
test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  undo?.();
  undo = undefined;
  Reflect.deleteProperty(globalThis, 'window');
});

/** Fetches from a server whose calls send these parts, and then fail if an error is given. */
async function fetched(calls: { parts: Part[]; error?: ConnectError }[], watch: object = {}) {
  const clients = await import('../../app/api/clients');
  const { fetchAnnotations } = await import('../../app/api/fetch_annotations');
  let numCalls = 0;
  async function* exportAnnotations() {
    const { parts, error } = calls[Math.min(numCalls++, calls.length - 1)] ?? { parts: [] };
    for (const part of parts) {
      yield create(ExportAnnotationsResponseSchema, { part: part as never });
    }
    if (error) throw error;
  }
  undo = replace(clients.labels, { exportAnnotations });
  const made: [number, number][] = [];
  const received: [number, number][] = [];
  const { signal } = new AbortController();
  const request = { model: 'm', format: AnnotationFormat.COCO };
  const follow = {
    signal,
    made: (...step: [number, number]) => void made.push(step),
    received: (...step: [number, number]) => void received.push(step),
    ...watch,
  };
  const file = await fetchAnnotations(request, follow).catch((error: unknown) => error);
  return { file, made, received, numCalls };
}

test('masks are counted while they are made, then bytes, and the zip comes whole', async () => {
  const { file, made, received } = await fetched([{ parts: whole }]);
  expect(Buffer.compare(Buffer.from(await (file as Blob).arrayBuffer()), zip)).toBe(0);
  expect(made).toEqual([
    [0, 0],
    [12, 45],
    [45, 45],
  ]);
  expect(received.map(([done]) => done)).toEqual([1 << 20, 2 << 20, zip.length]);
  expect(new Set(received.map(([, total]) => total))).toEqual(new Set([zip.length]));
});

test('a zip that is cut off or damaged is an error', async () => {
  const short = await fetched([{ parts: whole.slice(0, -1) }]);
  expect(ConnectError.from(short.file).code).toBe(Code.DataLoss);
  expect(ConnectError.from(short.file).rawMessage).toContain(`2097152 bytes instead of ${zip.length}`);
  undo?.();
  const damaged = Buffer.from(zip.subarray(2 << 20));
  damaged[7] = 0;
  const parts = [...whole.slice(0, -1), { case: 'chunk', value: damaged } as const];
  const other = await fetched([{ parts }]);
  expect(ConnectError.from(other.file).code).toBe(Code.DataLoss);
  expect(ConnectError.from(other.file).rawMessage).toContain('SHA-256');
  undo?.();
  expect(ConnectError.from((await fetched([{ parts: [] }])).file).code).toBe(Code.DataLoss);
});

test('what the server refuses is what the person reads', async () => {
  const error = new ConnectError('the scene has no label', Code.FailedPrecondition);
  const { file, numCalls } = await fetched([{ parts: [], error }]);
  expect(ConnectError.from(file).rawMessage).toBe('the scene has no label');
  expect(numCalls).toBe(1);
});

test('an export is made again after the server was away', async () => {
  const error = new ConnectError('the connection to the server was lost', Code.Unavailable);
  const { file, numCalls } = await fetched([{ parts: [progress(12n)], error }, { parts: whole }]);
  expect((file as Blob).size).toBe(zip.length);
  expect(numCalls).toBe(2);
});

test('who cancels gets no zip', async () => {
  const cancelled = new DOMException('cancelled', 'AbortError');
  const made = (done: number) => {
    if (done > 0) throw cancelled;
  };
  const { file, received, numCalls } = await fetched([{ parts: whole }], { made });
  expect(file).toBe(cancelled);
  expect(received).toEqual([]);
  expect(numCalls).toBe(1);
});

test('the request names the level of segments, the file’s name says what is in it', async () => {
  const { annotationsName, annotationsRequest } = await import('../../app/scene/annotation_tools');
  const yolo = { id: 'yolo', name: 'YOLO', format: AnnotationFormat.YOLO };
  expect(annotationsRequest('m', yolo, undefined, true)).toEqual({
    model: 'm',
    format: AnnotationFormat.YOLO,
    table: true,
  });
  expect(annotationsRequest('m', yolo, 0, false)).toMatchObject({ segments: { level: 0 } });
  expect(annotationsName('shelf', yolo, undefined)).toBe('shelf-yolo.zip');
  expect(annotationsName('shelf', yolo, 1)).toBe('shelf-objects-yolo.zip');
});
