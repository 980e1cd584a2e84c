import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import {
  FindSegmentsResponseSchema,
  FindSegmentsResponse_Source as Source,
} from '../../gen/pepeseg/v1/find_pb';
import { middleOf } from '../../app/mask/rle';
import { maskIn, model, replace } from './fake_session';
import { encode, firstColumns } from './runs';

const undo: (() => void)[] = [];
const box = { x: 1, y: 2, width: 3, height: 4 };

/** A thing that the server found: what it takes to segment it is a mask of the first view. */
function thing(word: string, score: number) {
  const mask = { image: { case: 'rle', value: firstColumns(10) } as const };
  return {
    word,
    score,
    prompt: {
      view: { place: { case: 'view', value: 'a.jpg' } as const },
      what: { case: 'mask', value: mask } as const,
    },
    granularity: { scale: { case: 'scaleQuantile', value: score } as const, threshold: 0.6 },
    appearances: [{ view: 'a.jpg', area: 12n, ...box }],
  };
}

interface Asked {
  what: { case: string; value: unknown };
  granularity: { threshold?: number };
  model: string;
}

interface AskedView {
  targets: { views: string[] };
  granularity: { threshold?: number; scale: { value: number } };
  prompt: { what: { case: string; value: unknown } };
}

let asked: Asked[];
let askedViews: AskedView[];
let response: object;

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { segmentation } = await import('../../app/api/clients');
  asked = [];
  askedViews = [];
  const findSegments = async (request: Asked) => {
    asked.push(request);
    return create(FindSegmentsResponseSchema, response);
  };
  const segmentViews = async (request: AskedView) => {
    askedViews.push(request);
    const [view = ''] = request.targets.views;
    const masks = [maskIn(view, firstColumns(10), 100n)];
    return { masks, scaleQuantile: 0.4, scaleUnits: 1, threshold: 0.7 };
  };
  undo.push(replace(segmentation, { findSegments, segmentViews }));
});
test.afterEach(() => {
  for (const back of undo.splice(0)) back();
  Reflect.deleteProperty(globalThis, 'window');
});

async function finderOf() {
  const { SceneFinder } = await import('../../app/scene/finder');
  return new SceneFinder(model);
}

test('things of a word are listed, and their masks in the shown view are asked for', async () => {
  const { describeFound } = await import('../../app/scene/found_things');
  response = { source: Source.DETECTOR, found: [thing('cup', 0.9), thing('cup', 0.5)] };
  const finder = await finderOf();
  finder.show('b.jpg');
  await finder.findWord('cup');
  expect(asked[0]).toMatchObject({ model, what: { case: 'text', value: 'cup' } });
  const { found, masks, busy, word } = finder.state.get();
  expect(found?.things.map(({ name, score }) => [name, score])).toEqual([
    ['cup', 0.9],
    ['cup', 0.5],
  ]);
  expect(found?.things[0]?.appearances[0]).toMatchObject({ view: 'a.jpg', ...box });
  expect([busy, masks.size, masks.get(1)?.area]).toEqual([false, 2, 100]);
  expect(found && describeFound(found, word)).toBe(
    '2 things, by a detector, in the photographs.',
  );
  // Each with the prompt, scale and threshold that the server gave.
  expect(askedViews.map(({ targets }) => targets.views)).toEqual([['b.jpg'], ['b.jpg']]);
  expect(askedViews[1]).toMatchObject({
    prompt: { what: { case: 'mask' } },
    granularity: { scale: { value: 0.5 }, threshold: 0.6 },
  });
  // Another view is asked for its masks.
  finder.show('c.jpg');
  await expect.poll(() => finder.state.get().masks.size).toBe(2);
  expect(askedViews.slice(2).map(({ targets }) => targets.views)).toEqual([['c.jpg'], ['c.jpg']]);
});

test('all that look alike are found by the prompt, its scale and threshold', async () => {
  const { describeFound } = await import('../../app/scene/found_things');
  response = { source: Source.APPEARANCE, found: [thing('', 0.8)] };
  const finder = await finderOf();
  const points = [{ x: 1, y: 2, negative: false }];
  const prompt = { kind: 'points', place: { view: 'a.jpg' }, points } as const;
  await finder.findLike(prompt, { scale: 0.3, threshold: 0.7 });
  expect(asked[0]).toMatchObject({
    what: { case: 'like', value: { what: { case: 'points', value: { points } } } },
    granularity: { scale: { value: 0.3 }, threshold: 0.7 },
  });
  const { found } = finder.state.get();
  expect(found && describeFound(found, '')).toBe(
    '1 thing, by how they look in the photographs.',
  );
});

test('a label that is found is segmented as a label', async () => {
  const label = 'scenes/shelf/labels/cup';
  const prompt = { what: { case: 'label', value: label } as const };
  response = { source: Source.LABELS, found: [{ ...thing('Cup', 1), label, prompt }] };
  const { labels } = await import('../../app/api/clients');
  const getLabel = async () => ({
    view: 'b.jpg',
    mask: { image: { case: 'rle', value: firstColumns(7) } },
  });
  undo.push(replace(labels, { getLabel }));
  const finder = await finderOf();
  finder.show('b.jpg');
  await finder.findWord('cup');
  expect(finder.state.get().found?.things[0]).toMatchObject({
    name: 'Cup',
    prompt: { kind: 'label', label },
    granularity: {},
  });
  // In its own view it has the accepted mask.
  expect(finder.state.get().masks.get(0)?.area).toBe(70);
  finder.show('a.jpg');
  await expect.poll(() => finder.state.get().masks.get(0)?.area).toBe(100);
});

test('nothing found: the best score, words that are spelt alike, and the known ones', async () => {
  const { describeFound } = await import('../../app/scene/found_things');
  const words = { didYouMean: ['cup'], knownWords: ['apple', 'cup'] };
  response = { bestScore: 0.12, bestWord: 'cup', ...words };
  const finder = await finderOf();
  await finder.findWord('cupp');
  const { found } = finder.state.get();
  expect(found).toMatchObject({ things: [], ...words });
  expect(found && describeFound(found, 'cupp')).toBe('No “cupp” here (best: cup, 0.12).');
  expect(found && describeFound({ ...found, bestScore: 0 }, 'cupp')).toBe('No “cupp” here.');
  expect(found && describeFound(found, '')).toBe('Nothing else looks like it.');
});

test('a newer search, and closing, forget an earlier one', async () => {
  const { segmentation } = await import('../../app/api/clients');
  let comes: (found: object) => void = () => undefined;
  const findSegments = () => new Promise((resolve) => (comes = resolve));
  undo.push(replace(segmentation, { findSegments }));
  const finder = await finderOf();
  const first = finder.findWord('cup');
  expect(finder.state.get()).toMatchObject({ busy: true, word: 'cup' });
  const late = comes;
  const second = finder.findWord('book');
  late(create(FindSegmentsResponseSchema, { found: [thing('cup', 0.9)] }));
  await first;
  expect(finder.state.get()).toMatchObject({ busy: true, word: 'book', found: undefined });
  finder.clear();
  comes(create(FindSegmentsResponseSchema, { found: [thing('book', 0.9)] }));
  await second;
  expect(finder.state.get()).toMatchObject({ busy: false, found: undefined });
});

test('a refused search says why', async () => {
  const { segmentation } = await import('../../app/api/clients');
  const findSegments = () => Promise.reject(new ConnectError('too busy', Code.Aborted));
  undo.push(replace(segmentation, { findSegments }));
  const finder = await finderOf();
  await finder.findWord('cup');
  expect(finder.state.get()).toMatchObject({ busy: false, failure: { what: 'Too busy.' } });
});

test('the number of a thing is in the middle of its mask, whatever stray pixels there are', () => {
  expect(middleOf(firstColumns(10))).toEqual({ x: 5, y: 5 });
  // Columns 2 to 5, rows 2 to 7, and two stray pixels far away.
  const columns = [22, 6, 4, 6, 4, 6, 4, 6, 300, 2, 640];
  expect(middleOf({ width: 100, height: 10, counts: encode(columns) })).toEqual({ x: 4, y: 5 });
});
