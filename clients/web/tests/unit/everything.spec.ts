import { expect, test } from '@playwright/test';
import { History } from '../../app/history';
import { decodeRle } from '../../app/mask/rle';
import { replace } from './fake_session';
import { pngOf } from './grey_pngs';

const model = 'scenes/shelf/models/1';
const size = { width: 2, height: 2 };
const undo: (() => void)[] = [];
let decomposed: number;
let fetched: string[];
/** Lets the decomposition be answered, if a test holds it. */
let release: Promise<void>;

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { segmentation, selections } = await import('../../app/api/clients');
  decomposed = 0;
  fetched = [];
  release = Promise.resolve();
  const level = { segments: [{ numGaussians: 500n }, { numGaussians: 20n }] };
  let numSelections = 0;
  undo.push(
    replace(segmentation, {
      decomposeModel: async (_: object, { signal }: { signal: AbortSignal }) => {
        decomposed += 1;
        await release;
        signal.throwIfAborted();
        return { levels: [level, level, level] };
      },
    }),
    replace(selections, {
      createSelection: async (request: object) => ({ ...request, name: `s${++numSelections}` }),
      undoSelection: async () => ({ name: 's1' }),
    }),
    replace(globalThis, {
      fetch: async (url: string) => {
        fetched.push(url);
        return new Response(Uint8Array.from(pngOf(2, [1, 2, 0, 2])));
      },
    }),
  );
});
test.afterEach(() => {
  for (const back of undo.splice(0)) back();
  Reflect.deleteProperty(globalThis, 'window');
});

async function made() {
  const { SceneEverything } = await import('../../app/scene/everything');
  const { SceneSelections } = await import('../../app/scene/selections');
  const history = new History();
  const selections = new SceneSelections(model, history);
  const everything = new SceneEverything(model, selections);
  everything.show('a.jpg', size);
  const seen = () => expect.poll(() => everything.state.get().seen).toBeDefined();
  return { everything, selections, history, state: () => everything.state.get(), seen };
}

test('the scene is split once, and each view and level drawn once', async () => {
  const { everything, state, seen } = await made();
  expect([decomposed, fetched.length]).toEqual([0, 0]);
  everything.turn(true);
  expect(state().waits).toBe('decomposition');
  await seen();
  expect(state().waits).toBe('nothing');
  expect(everything.numGaussians({ level: 1, id: 2 })).toBe(20);
  everything.choose(2);
  expect(state().seen).toBeUndefined();
  await seen();
  everything.show('b.jpg', size);
  await seen();
  everything.choose(1);
  await seen();
  everything.show('a.jpg', size);
  expect(state().seen?.view).toBe('a.jpg'); // without a request
  const asked = fetched.map((url) => new URL(url, 'http://app').searchParams);
  expect(asked.map((query) => `${query.get('view')} ${query.get('level')}`)).toEqual([
    'a.jpg 1',
    'a.jpg 2',
    'b.jpg 2',
    'b.jpg 1',
  ]);
  expect(decomposed).toBe(1);
});

test('the pointer emphasises the segment under it, whose mask is its prompt', async () => {
  const { everything, seen } = await made();
  everything.turn(true);
  everything.pointer.move('a.jpg', { x: 0.5, y: 0.5 });
  expect(everything.under.get()).toBe(0); // there is no picture yet
  await seen();
  everything.pointer.move('a.jpg', { x: 1.5, y: 0.5 });
  expect(everything.under.get()).toBe(2);
  const prompt = everything.promptAt(1.5, 0.5);
  expect(prompt).toMatchObject({ isExact: true, segment: { level: 1, id: 2 } });
  expect(prompt && [...decodeRle(prompt.rle)]).toEqual([0, 1, 0, 1]);
  expect(everything.promptAt(0.5, 1.5)).toBeUndefined();
  everything.pointer.leave();
  expect(everything.under.get()).toBe(0);
});

test('a decomposition that takes long can be cancelled, and asked for again', async () => {
  let go: () => void = () => undefined;
  release = new Promise((resolve) => {
    go = resolve;
  });
  const { everything, state, seen } = await made();
  everything.turn(true);
  await expect.poll(() => decomposed).toBe(1);
  everything.turn(false);
  go();
  await new Promise((resolve) => setTimeout(resolve, 20));
  expect(state()).toMatchObject({ isOn: false, waits: 'nothing', decomposition: undefined });
  expect([state().failure, fetched.length]).toEqual([undefined, 0]);
  everything.turn(true);
  await seen();
  expect(decomposed).toBe(2);
});

test('segments are hidden one after the other, as the selection says', async () => {
  const { everything, selections, history, state, seen } = await made();
  everything.turn(true);
  await seen();
  const [first, second] = [1, 2].map((id) => everything.promptOf(id));
  if (!first || !second) throw new Error('no segments');
  expect(await everything.hide(first, { level: 1, id: 1 })).toBe(true);
  expect(selections.state.get()).toMatchObject({
    showing: 'hidden',
    selection: { source: { case: 'segment', value: { level: 1, id: 1 } } },
  });
  await everything.hide(second, { level: 1, id: 2 });
  expect(selections.state.get().selection).toMatchObject({ base: 's1' });
  expect(state().hidden).toHaveLength(2);
  await history.undo();
  expect(state().hidden).toEqual([{ level: 1, id: 1 }]);
  // Where the selection is shown in another way, nothing is hidden.
  selections.show('tinted');
  expect(state().hidden).toEqual([]);
  selections.show('hidden');
  expect(state().hidden).toHaveLength(1);
  selections.clear();
  expect(state().hidden).toEqual([]);
  await history.undo();
  expect(state().hidden).toHaveLength(1);
});

test('the mask of a segment stays the answer in its view', async () => {
  const { fakeSession, maskIn } = await import('./fake_session');
  const { session, answerWith, asked } = await fakeSession();
  const { everything, seen } = await made();
  everything.turn(true);
  await seen();
  const prompt = everything.promptOf(2);
  if (!prompt) throw new Error('no segment');
  session.pose(prompt);
  const shown = () => session.state.get().answer?.masks.get('a.jpg');
  expect(shown()).toMatchObject({ rle: prompt.rle, area: 2 }); // at once
  expect(asked[0]?.prompt?.what.case).toBe('mask');
  answerWith([maskIn('a.jpg'), maskIn('b.jpg')]);
  expect(shown()).toMatchObject({ rle: prompt.rle, area: 2 });
  expect(session.state.get().answer?.masks.get('b.jpg')?.area).toBe(1);
  session.end();
});
