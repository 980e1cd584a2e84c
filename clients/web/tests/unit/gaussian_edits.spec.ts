// What a person does to the Gaussians in 3D.
import { expect, test } from '@playwright/test';
import type { GaussianEdits } from '../../app/gaussians/gaussian_edits';
import { readGaussianPly } from '../../app/gaussians/gaussian_ply';
import type { GaussianWork } from '../../app/gaussians/gaussian_work';
import { History } from '../../app/history';
import { plyWith } from './gaussian_plys';

const ply = plyWith([0, 1, 2, 3].map((x) => ({ center: [x, 0, 0] })));
/** What the worker does; the last Gaussian is a floater. */
const work: GaussianWork = {
  read: async (file) => readGaussianPly(await file.arrayBuffer()),
  floaters: async () => Uint8Array.of(0, 0, 0, 1),
  end: () => undefined,
};
let asked: string[] = [];
let history: History;
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
  history = new History();
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

async function newEdits(first?: Uint8Array): Promise<GaussianEdits> {
  const module = await import('../../app/gaussians/gaussian_edits');
  return new module.GaussianEdits('scenes/shelf/models/1', history, first, work);
}

async function unseen(edits: GaussianEdits): Promise<number[]> {
  const { unseenOf } = await import('../../app/gaussians/gaussian_edits');
  const { edits: edited, gaussians } = edits.state.get();
  return gaussians ? indices(unseenOf(edited, gaussians)) : [];
}

/** Returns the indices in a set. */
function indices(set: Readonly<Uint8Array>): number[] {
  return [...set].flatMap((isIn, i) => (isIn ? [i] : []));
}

test('Gaussians are loaded once, when something is picked', async () => {
  const edits = await newEdits();
  expect(asked).toEqual([]);
  await Promise.all([
    edits.pick(async () => Uint8Array.of(1, 1, 0, 0), 'replace'),
    edits.pick(async () => Uint8Array.of(0, 1, 1, 0), 'subtract'),
  ]);
  expect(asked).toEqual(['/api/ply?model=scenes%2Fshelf%2Fmodels%2F1']);
  const { edits: edited, numPicked, loading } = edits.state.get();
  expect([indices(edited.picked), numPicked, loading]).toEqual([[0], 1, undefined]);
});

test('picks are made one after the other, whatever each takes', async () => {
  const edits = await newEdits();
  const slow = async () => {
    await new Promise((resolve) => setTimeout(resolve, 20));
    return Uint8Array.of(1, 1, 0, 0);
  };
  await Promise.all([
    edits.pick(slow, 'replace'),
    expect(edits.pick(() => Promise.reject(new Error('no sight')), 'add')).rejects.toThrow('no sight'),
    edits.pick(async () => Uint8Array.of(0, 0, 0, 1), 'add'),
  ]);
  expect(indices(edits.state.get().edits.picked)).toEqual([0, 1, 3]);
});

test('what is hidden is no longer picked, and comes back', async () => {
  const edits = await newEdits();
  await edits.pick(async () => Uint8Array.of(0, 1, 0, 0), 'replace');
  edits.showAlone(true);
  expect(await unseen(edits)).toEqual([0, 2, 3]);
  edits.hidePicked();
  expect(await unseen(edits), 'all others are seen again').toEqual([1]);
  await edits.pick(async () => Uint8Array.of(0, 0, 0, 1), 'replace');
  edits.hidePicked();
  expect([edits.state.get().numHidden, edits.state.get().numPicked]).toEqual([2, 0]);
  edits.hidePicked();
  expect(edits.state.get().numHidden, 'nothing is picked').toBe(2);
  edits.showHidden();
  expect(await unseen(edits)).toEqual([]);
});

test('with nothing picked, nothing is shown alone', async () => {
  const edits = await newEdits();
  await edits.pick(async () => Uint8Array.of(0, 1, 0, 0), 'replace');
  edits.showAlone(true);
  await edits.pick(async () => Uint8Array.of(0, 1, 0, 0), 'subtract');
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

test('the crop box cuts off what is outside, next to what is hidden', async () => {
  const edits = await newEdits();
  await edits.pick(async () => Uint8Array.of(0, 1, 0, 0), 'replace');
  edits.hidePicked();
  await edits.turnCrop(true);
  edits.cropTo({ min: [0.5, -1, -1], max: [9, 1, 1] });
  expect(await unseen(edits)).toEqual([0, 1]);
  expect(indices(edits.kept())).toEqual([2, 3]);
  expect(edits.state.get().numHidden, 'the box hides for itself').toBe(1);
  await edits.turnCrop(false);
  expect(await unseen(edits)).toEqual([1]);
});

test('floaters are picked, but for those that are hidden, and hidden when the person says so', async () => {
  const edits = await newEdits();
  await edits.pickFloaters([]);
  expect([edits.state.get().numFloaters, indices(edits.state.get().edits.picked)]).toEqual([1, [3]]);
  expect(await unseen(edits)).toEqual([]);
  edits.hidePicked();
  expect(await unseen(edits)).toEqual([3]);
  expect(edits.state.get().numFloaters).toBeUndefined();
  await edits.pickFloaters([]);
  expect(edits.state.get().numFloaters).toBe(0);
});

test('a model that is shown again has its picks and what is hidden', async () => {
  const edits = await newEdits();
  edits.begin();
  expect(asked, 'nothing was done yet').toEqual([]);
  await edits.pick(async () => Uint8Array.of(1, 0, 0, 0), 'replace');
  edits.hidePicked();
  await edits.pick(async () => Uint8Array.of(0, 1, 0, 0), 'replace');
  edits.end();
  expect(edits.state.get().gaussians).toBeUndefined();
  edits.begin();
  await edits.load();
  expect(asked).toHaveLength(2);
  expect([await unseen(edits), edits.state.get().numPicked]).toEqual([[0], 1]);
  await history.undo();
  expect(edits.state.get().numPicked).toBe(0);
});

test('what an edit changed is picked at first', async () => {
  const edits = await newEdits(Uint8Array.of(0b1010));
  edits.begin();
  await edits.load();
  expect(indices(edits.state.get().edits.picked)).toEqual([1, 3]);
  expect(edits.state.get().numPicked).toBe(2);
  edits.clear();
  edits.end();
  await edits.load();
  expect(edits.state.get().numPicked, 'it is not picked a second time').toBe(0);
});

test('each change is undone and done again, a drag of the crop box as one', async () => {
  const edits = await newEdits();
  await edits.pick(async () => Uint8Array.of(1, 1, 0, 0), 'replace');
  edits.hidePicked();
  await edits.turnCrop(true);
  const { crop } = edits.state.get().edits;
  for (const max of [2.5, 2, 1.5]) edits.cropTo({ min: [-1, -1, -1], max: [max, 1, 1] });
  edits.restCrop();
  expect(await unseen(edits)).toEqual([0, 1, 2, 3]);
  const undone: unknown[] = [];
  for (let name = history.state.get().undo; name; name = history.state.get().undo) {
    await history.undo();
    undone.push([name, edits.state.get().edits.crop, await unseen(edits), edits.state.get().numPicked]);
  }
  expect(undone).toEqual([
    ['Crop', crop, [0, 1], 0],
    ['Crop box', undefined, [0, 1], 0],
    ['Hide', undefined, [], 2],
    ['Pick', undefined, [], 0],
  ]);
  while (history.state.get().redo) await history.redo();
  expect(await unseen(edits)).toEqual([0, 1, 2, 3]);
});
