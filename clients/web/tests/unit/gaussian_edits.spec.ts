// What a person does to the Gaussians in 3D.
import { expect, test } from '@playwright/test';
import type { GaussianEdits } from '../../app/gaussians/gaussian_edits';
import { plyWith } from './gaussian_plys';

const ply = plyWith([0, 1, 2, 3].map((x) => ({ center: [x, 0, 0] })));
let asked: string[] = [];
let status = 200;
const fetchBefore = globalThis.fetch;

// Node has no window. It is there during the tests only, since the transport takes a window for a browser's.
test.beforeAll(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterAll(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

test.beforeEach(() => {
  asked = [];
  status = 200;
  globalThis.fetch = (async (url: string) => {
    asked.push(url);
    return new Response(status === 200 ? ply : '{"code":5,"message":"gone"}', { status });
  }) as typeof fetch;
});

test.afterEach(() => {
  globalThis.fetch = fetchBefore;
});

async function newEdits(): Promise<GaussianEdits> {
  const module = await import('../../app/gaussians/gaussian_edits');
  return new module.GaussianEdits('scenes/shelf/models/1');
}

async function unseen(edits: GaussianEdits): Promise<number[]> {
  const { unseenOf } = await import('../../app/gaussians/gaussian_edits');
  return indices(unseenOf(edits.state.get().edits));
}

/** Returns the indices in a set. */
function indices(set: Readonly<Uint8Array>): number[] {
  return [...set].flatMap((isIn, i) => (isIn ? [i] : []));
}

test('Gaussians are loaded once, when something is picked', async () => {
  const edits = await newEdits();
  expect(asked).toEqual([]);
  await Promise.all([
    edits.pick(() => Uint8Array.of(1, 1, 0, 0), 'replace'),
    edits.pick(() => Uint8Array.of(0, 1, 1, 0), 'subtract'),
  ]);
  expect(asked).toEqual(['/api/ply?model=scenes%2Fshelf%2Fmodels%2F1']);
  const { edits: edited, numPicked, loading } = edits.state.get();
  expect([indices(edited.picked), numPicked, loading]).toEqual([[0], 1, undefined]);
});

test('what is hidden is no longer picked, and comes back', async () => {
  const edits = await newEdits();
  await edits.pick(() => Uint8Array.of(0, 1, 0, 0), 'replace');
  edits.showAlone(true);
  expect(await unseen(edits)).toEqual([0, 2, 3]);
  edits.hidePicked();
  expect(await unseen(edits), 'all others are seen again').toEqual([1]);
  await edits.pick(() => Uint8Array.of(0, 0, 0, 1), 'replace');
  edits.hidePicked();
  expect([edits.state.get().numHidden, edits.state.get().numPicked]).toEqual([2, 0]);
  edits.hidePicked();
  expect(edits.state.get().numHidden, 'nothing is picked').toBe(2);
  edits.showHidden();
  expect(await unseen(edits)).toEqual([]);
});

test('with nothing picked, nothing is shown alone', async () => {
  const edits = await newEdits();
  await edits.pick(() => Uint8Array.of(0, 1, 0, 0), 'replace');
  edits.showAlone(true);
  await edits.pick(() => Uint8Array.of(0, 1, 0, 0), 'subtract');
  expect(await unseen(edits)).toEqual([]);
});

test('a refused file is a failure, after which it is asked for again', async () => {
  status = 404;
  const edits = await newEdits();
  await edits.load();
  const { failure, gaussians } = edits.state.get();
  expect([failure?.what, gaussians]).toEqual(['Gone.', undefined]);
  edits.closeFailure();
  status = 200;
  await edits.load();
  expect(edits.state.get().gaussians?.count).toBe(4);
});
