// Picks with names, which the server keeps.
import { expect, test } from '@playwright/test';
import type { GaussianEdits } from '../../app/gaussians/gaussian_edits';
import { readGaussianPly } from '../../app/gaussians/gaussian_ply';
import type { StoredPicks } from '../../app/gaussians/stored_picks';
import { History } from '../../app/history';
import type { Selection } from '../../gen/pepeseg/v1/selection_service_pb';
import { model, replace } from './fake_session';
import { plyWith } from './gaussian_plys';

const ply = plyWith([0, 1, 2, 3].map((x) => ({ center: [x, 0, 0] })));
const undo: (() => void)[] = [];
let kept: { name: string; model: string; displayName: string; bits: Uint8Array }[];
let numFetched: number;
let history: History;
let edits: GaussianEdits;
let stored: StoredPicks;
const fetchBefore = globalThis.fetch;

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  globalThis.fetch = (async () => new Response(ply)) as typeof fetch;
  const { selections } = await import('../../app/api/clients');
  const { GaussianEdits } = await import('../../app/gaussians/gaussian_edits');
  const { StoredPicks } = await import('../../app/gaussians/stored_picks');
  kept = [
    { name: 's/1', model, displayName: 'Old cup', bits: Uint8Array.of(0b0110) },
    { name: 's/2', model: 'scenes/shelf/models/7', displayName: 'Of another version', bits: Uint8Array.of(1) },
    { name: 's/3', model, displayName: '', bits: Uint8Array.of(1) },
  ];
  numFetched = 0;
  let newest = 10;
  undo.push(
    replace(selections, {
      listSelections: async () => ({ selections: kept, nextPageToken: '' }),
      createSelection: async (request: {
        model: string;
        displayName: string;
        source: { case: string; value: { bits: Uint8Array } };
      }) => {
        const { displayName, source } = request;
        const made = { name: `s/${newest++}`, model: request.model, displayName, bits: source.value.bits };
        kept = [made, ...kept];
        return made;
      },
      getSelection: async ({ name, wantGaussians }: { name: string; wantGaussians: boolean }) => {
        numFetched += 1;
        const found = kept.find((other) => other.name === name);
        return wantGaussians && found ? { gaussians: { bits: found.bits } } : {};
      },
      deleteSelection: async ({ name }: { name: string }) => {
        kept = kept.filter((other) => other.name !== name);
      },
    }),
  );
  history = new History();
  edits = new GaussianEdits(model, history, undefined, {
    read: async (file) => readGaussianPly(await file.arrayBuffer()),
    floaters: async () => new Uint8Array(4),
    end: () => undefined,
  });
  stored = new StoredPicks({ scene: 'scenes/shelf', model }, edits, history);
  await stored.load();
});

test.afterEach(() => {
  globalThis.fetch = fetchBefore;
  for (const putBack of undo.splice(0)) putBack();
  Reflect.deleteProperty(globalThis, 'window');
});

const names = () => stored.state.get().list.map(({ displayName }) => displayName);
const first = () => stored.state.get().list[0] as Selection;

test('only selections of the model that have names are listed', () => {
  expect(names()).toEqual(['Old cup']);
});

test('picks are stored under a name, which is undone and done again', async () => {
  await edits.pick(async () => Uint8Array.of(1, 0, 0, 1), 'replace');
  expect(await stored.store('Lid')).toBe(true);
  expect([names(), kept[0]?.bits]).toEqual([['Lid', 'Old cup'], Uint8Array.of(0b1001)]);
  expect(history.state.get().undo).toBe('Name “Lid”');
  await history.undo();
  expect(names()).toEqual(['Old cup']);
  await history.redo();
  expect([names(), kept[0]?.bits]).toEqual([['Lid', 'Old cup'], Uint8Array.of(0b1001)]);
});

test('a stored selection is picked again', async () => {
  expect(await stored.choose(first())).toBe(true);
  expect([...edits.state.get().edits.picked]).toEqual([0, 1, 1, 0]);
  await stored.choose(first());
  expect(numFetched, 'its Gaussians are fetched once').toBe(1);
});

test('the eye hides a stored selection and shows it, next to what else is hidden', async () => {
  const { isHidden } = await import('../../app/gaussians/stored_picks');
  await edits.pick(async () => Uint8Array.of(1, 0, 0, 0), 'replace');
  edits.hidePicked();
  await stored.toggle(first());
  const set = stored.state.get().sets.get('s/1');
  expect([...edits.state.get().edits.hidden]).toEqual([1, 1, 1, 0]);
  expect(isHidden(set, edits.state.get().edits.hidden)).toBe(true);
  expect(history.state.get().undo).toBe('Hide “Old cup”');
  await stored.toggle(first());
  expect([...edits.state.get().edits.hidden]).toEqual([1, 0, 0, 0]);
  expect(isHidden(set, edits.state.get().edits.hidden)).toBe(false);
  expect(isHidden(undefined, edits.state.get().edits.hidden)).toBe(false);
});

test('a deletion is undone with the same Gaussians', async () => {
  await stored.remove(first());
  expect(names()).toEqual([]);
  await history.undo();
  expect([names(), kept[0]?.bits]).toEqual([['Old cup'], Uint8Array.of(0b0110)]);
  await history.redo();
  expect(names()).toEqual([]);
});

test('bits of another number of Gaussians are a failure', async () => {
  kept = [{ name: 's/1', model, displayName: 'Old cup', bits: Uint8Array.of(1, 2, 3) }];
  expect(await stored.choose(first())).toBe(false);
  expect(stored.state.get().failure?.what).toContain('not the bits of 4 Gaussians');
  expect(edits.state.get().numPicked).toBe(0);
});
