// Named things in their colours: their masks in a view, their Gaussians in 3D, and names of segments.
import { expect, test } from '@playwright/test';
import { SetOperation } from '../../gen/pepeseg/v1/selection_service_pb';
import { splatParts } from '../../app/scene/splat_parts';
import { maskIn, model, onePixel, replace } from './fake_session';
import { firstColumns } from './runs';

const undo: (() => void)[] = [];
let segmented: string[];
let calls: string[];
/** Names of selections without Gaussians. */
let empty: Set<string>;

const labelOf = (id: string) => ({ name: `scenes/shelf/labels/${id}`, text: id }) as never;

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { labels, segmentation, selections } = await import('../../app/api/clients');
  segmented = [];
  calls = [];
  empty = new Set();
  const made = (name: string) => ({ name, numGaussians: empty.has(name) ? 0n : 5n });
  undo.push(
    replace(labels, {
      // Each label was named in the view of its own name.
      getLabel: async ({ name }: { name: string }) => ({
        view: `${name.split('/').at(-1)}.jpg`,
        mask: { image: { case: 'rle', value: onePixel } },
      }),
    }),
    replace(segmentation, {
      segmentViews: async (request: {
        prompt: { what: { value: string } };
        targets: { views: string[] };
      }) => {
        const view = request.targets.views[0] ?? '';
        segmented.push(`${request.prompt.what.value.split('/').at(-1)} ${view}`);
        return { masks: [maskIn(view)], scaleQuantile: 0.4, scaleUnits: 1, threshold: 0.7 };
      },
    }),
    replace(selections, {
      createSelection: async ({ source }: { source: { value: { what: { value: string } } } }) => {
        const name = source.value.what.value.split('/').at(-1) ?? '';
        calls.push(name);
        return made(name);
      },
      combineSelections: async (request: {
        first: string;
        second: string;
        operation: SetOperation;
      }) => {
        const sign = request.operation === SetOperation.UNION ? '+' : '-';
        const name = `${request.first}${sign}${request.second}`;
        calls.push(name);
        return made(name);
      },
      deleteSelection: async ({ name }: { name: string }) => void calls.push(`delete ${name}`),
    }),
  );
});
test.afterEach(() => {
  for (const back of undo.splice(0)) back();
  Reflect.deleteProperty(globalThis, 'window');
});

async function made() {
  const { SceneLabels } = await import('../../app/scene/labels');
  const { ThingMasks } = await import('../../app/scene/thing_masks');
  const { ThingsIn3d } = await import('../../app/scene/things_in_3d');
  const labels = new SceneLabels('scenes/shelf');
  const things = new ThingMasks(model, labels);
  return { labels, things, in3d: new ThingsIn3d(model, labels) };
}

test('things are segmented once in each view, one is not shown, and its own view has its mask', async () => {
  const { labels, things } = await made();
  const shown = () => [...things.state.get().masks.keys()].map((name) => name.split('/').at(-1));
  things.show('cup.jpg');
  expect(things.state.get().busy).toBe(false);
  labels.list.set([labelOf('cup'), labelOf('jug')]);
  expect(things.state.get().busy).toBe(true);
  await expect.poll(shown).toEqual(['cup', 'jug']);
  await expect.poll(() => things.state.get().busy).toBe(false);
  expect(segmented).toEqual(['jug cup.jpg']); // the cup's mask was accepted
  things.toggle('scenes/shelf/labels/jug');
  things.show('b.jpg');
  await expect.poll(shown).toEqual(['cup']);
  expect(segmented).toEqual(['jug cup.jpg', 'cup b.jpg']);
  things.toggle('scenes/shelf/labels/jug');
  await expect.poll(shown).toEqual(['cup', 'jug']);
  things.show('cup.jpg');
  expect(shown()).toEqual(['cup', 'jug']);
  // A deleted thing is forgotten; one of its name is segmented again.
  labels.list.set([labelOf('cup')]);
  expect(shown()).toEqual(['cup']);
  segmented = [];
  labels.list.set([labelOf('cup'), labelOf('jug')]);
  await expect.poll(shown).toEqual(['cup', 'jug']);
  expect(segmented).toEqual(['jug cup.jpg']);
  // Off, nothing is asked.
  segmented = [];
  things.turn(false);
  things.show('c.jpg');
  await new Promise((resolve) => setTimeout(resolve, 10));
  expect(segmented).toEqual([]);
  things.end();
});

test('in 3D each Gaussian has the colour of one thing, and selections are deleted in the end', async () => {
  const { labels, in3d } = await made();
  labels.list.set(['cup', 'jug', 'tin'].map(labelOf));
  expect(calls).toEqual([]);
  empty.add('tin-cup+jug'); // the others have all of it
  in3d.turn(true);
  await expect.poll(() => in3d.state.get().busy).toBe(false);
  expect(calls).toEqual(['cup', 'jug', 'jug-cup', 'cup+jug', 'tin', 'tin-cup+jug', 'cup+jug+tin']);
  const { things } = in3d.state.get();
  expect(things?.all).toBe('cup+jug+tin');
  expect(things?.parts.map(({ selection }) => selection)).toEqual(['cup', 'jug-cup']);
  calls = [];
  in3d.turn(false);
  expect(in3d.state.get().things).toBeUndefined();
  expect(calls).toHaveLength(7);
  expect(calls.every((call) => call.startsWith('delete '))).toBe(true);
});

test('in 3D things that are named later are coloured, too', async () => {
  const { labels, in3d } = await made();
  in3d.turn(true);
  expect(in3d.state.get()).toMatchObject({ busy: false, things: undefined });
  labels.list.set([labelOf('cup')]);
  await expect.poll(() => in3d.state.get().things?.all).toBe('cup');
  in3d.turn(false);
});

test('a selection that is shown comes before the things, which are drawn over the rest', () => {
  const things = {
    all: 's9',
    parts: [
      { selection: 's1', color: [255, 0, 0] as const },
      { selection: 's2', color: undefined },
    ],
  };
  const drawn = (...args: Parameters<typeof splatParts>) =>
    splatParts(...args).map(({ url, tint }) => {
      const query = new URL(url, 'http://app').searchParams;
      return [query.get('selection'), query.get('complement'), tint !== undefined];
    });
  expect(drawn('m', undefined, 'all', undefined)).toEqual([[null, null, false]]);
  expect(drawn('m', 's5', 'all', things)).toEqual([
    ['s9', '1', false],
    ['s1', null, true],
    ['s2', null, false],
  ]);
  expect(drawn('m', 's5', 'tinted', things)).toEqual([
    ['s5', '1', false],
    ['s5', null, true],
  ]);
  expect(drawn('m', 's5', 'hidden', things)).toEqual([['s5', '1', false]]);
  expect(drawn('m', 's5', 'isolated', things)).toEqual([['s5', null, false]]);
});

test('a segment has the name of the thing whose mask it has', async () => {
  const { segmentWith } = await import('../../app/scene/segment_names');
  // Ten columns of segment 1, twenty of segment 2, twenty of none; half as large as the photograph.
  const values = Uint16Array.from({ length: 50 * 5 }, (_, i) => {
    const x = i % 50;
    return x < 10 ? 1 : x < 30 ? 2 : 0;
  });
  const picture = { width: 50, height: 5, values };
  expect(segmentWith(picture, firstColumns(20))).toBe(1);
  expect(segmentWith(picture, firstColumns(12))).toBe(1); // IoU 0.6
  expect(segmentWith(picture, firstColumns(60))).toBe(2); // IoU 20 / 30
  expect(segmentWith(picture, firstColumns(8))).toBeUndefined(); // IoU 0.4
});
