import { Code } from '@connectrpc/connect';
import { create } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import { errorWith } from '../../contract/error_detail';
import type { Label } from '../../gen/pepeseg/v1/label_service_pb';
import { LabelSchema } from '../../gen/pepeseg/v1/label_service_pb';
import { cocoJson } from '../../app/mask/coco';
import { answerIn, firstRow, model, onePixel, replace, views } from './fake_session';

interface Asked {
  prompt?: { what: { value: string } };
  targets: { views: string[] };
  granularity: { threshold?: number };
  samBorders?: boolean;
  samClicks: boolean;
}

const undo: (() => void)[] = [];
let asked: Asked[];
let hasSam: boolean;
let labels: Label[];

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const clients = await import('../../app/api/clients');
  asked = [];
  hasSam = false;
  labels = ['cup', 'book'].map((id) =>
    create(LabelSchema, { name: `scenes/shelf/labels/${id}`, text: id.toUpperCase() }),
  );
  const segmentViews = async (request: Asked) => {
    const reason = hasSam ? 'BAD_FIELD' : 'NO_SAM';
    if (!request.prompt) throw errorWith(Code.InvalidArgument, 'refused', { reason });
    asked.push(request);
    return answerIn(...request.targets.views);
  };
  const getLabel = async ({ name }: { name: string }) => ({
    view: name.endsWith('cup') ? 'b.jpg' : 'e.jpg',
    mask: { image: { case: 'rle', value: firstRow } },
  });
  undo.push(replace(clients.segmentation, { segmentViews }), replace(clients.labels, { getLabel }));
});
test.afterEach(() => {
  for (const back of undo.splice(0).reverse()) back();
  Reflect.deleteProperty(globalThis, 'window');
});

const answer = { masks: new Map(), scale: 0.4, scaleUnits: 1, threshold: 0.7, computeMs: 1 };

async function exported(
  progress: (done: number, total: number) => void = () => undefined,
  inViews: readonly string[] = views,
) {
  const { masksOfThings, thingOf } = await import('../../app/scene/things');
  const { nothingAsked } = await import('../../app/scene/session_state');
  const things = labels.map(({ name: label }) => {
    const state = { ...nothingAsked, prompt: { kind: 'label', label } as const, answer };
    const thing = thingOf(labels, state);
    if (!thing) throw new Error('a label is a thing');
    return thing;
  });
  const { signal } = new AbortController();
  return masksOfThings(model, things, inViews, { progress, signal });
}

test('in a label’s own view an export has the accepted mask, byte for byte', async () => {
  const segments = await exported();
  expect(segments.map(({ id, category }) => [id, category])).toEqual([
    ['cup', 'CUP'],
    ['book', 'BOOK'],
  ]);
  for (const { id, masks } of segments) {
    expect(masks.map(({ view }) => view)).toEqual(views);
    const own = id === 'cup' ? 'b.jpg' : 'e.jpg';
    for (const { view, rle } of masks) expect(rle).toEqual(view === own ? firstRow : onePixel);
  }
  const sizes = views.map((view) => ({ view, width: 2, height: 2 }));
  expect(cocoJson('shelf', sizes, segments)).toMatchObject({
    annotations: expect.arrayContaining([
      expect.objectContaining({
        image_id: 2,
        category_id: 1,
        segmentation: { size: [2, 2], counts: firstRow.counts },
        area: 2,
        bbox: [0, 0, 2, 1],
      }),
    ]),
  });
  // The accepted masks were not made again.
  const own = asked.filter(({ prompt }) => prompt?.what.value.endsWith('cup'));
  expect(own.flatMap(({ targets }) => targets.views)).not.toContain('b.jpg');
});

test('all views of a label get the scale and threshold of its first ones', async () => {
  await exported();
  const book = asked.filter(({ prompt }) => prompt?.what.value.endsWith('book'));
  expect(book.map(({ granularity }) => granularity.threshold)).toEqual([undefined, 0.7]);
});

test('SAM places the borders of an export where the server lets it, in small requests', async () => {
  await exported();
  const most = () => Math.max(...asked.map(({ targets }) => targets.views.length));
  const withoutSam = most();
  expect(new Set(asked.map(({ samBorders }) => samBorders))).toEqual(new Set([undefined]));
  asked = [];
  hasSam = true;
  await exported();
  expect(new Set(asked.map(({ samBorders }) => samBorders))).toEqual(new Set([undefined]));
  expect(most()).toBeLessThanOrEqual(withoutSam);
});

test('an export with SAM keeps to the server’s limit of 100 views per request', async () => {
  hasSam = true;
  labels = labels.slice(0, 1);
  const many = Array.from({ length: 250 }, (_, i) => `${i}.jpg`);
  const [segment] = await exported(() => undefined, many);
  expect(Math.max(...asked.map(({ targets }) => targets.views.length))).toBeLessThanOrEqual(100);
  expect(asked.flatMap(({ targets }) => targets.views)).toEqual(many);
  expect(segment?.masks.map(({ view }) => view)).toEqual(many);
});

test('the shown segment is exported, at its scale and threshold', async () => {
  const { thingOf } = await import('../../app/scene/things');
  const prompt = {
    kind: 'box',
    place: { view: 'a.jpg' },
    box: { x: 0, y: 0, width: 1, height: 1 },
  };
  const asked = { prompt: prompt as never, granularity: { scale: 0.9 }, answer };
  const state = { ...asked, samClicks: 'on' as const };
  const thing = { id: 'segment', category: 'segment', prompt, samClicks: 'off' };
  const expected = { ...thing, granularity: { scale: 0.9, threshold: 0.7 } };
  expect(thingOf([], state)).toEqual(expected);
  expect(thingOf(labels, state), 'whatever else has a name').toEqual(expected);
  expect(thingOf([], { ...state, answer: undefined })).toBeUndefined();
});

test('a segment that SAM has answered is exported as SAM answers it', async () => {
  const { masksOfThings, thingOf } = await import('../../app/scene/things');
  hasSam = true;
  const points = [{ x: 0, y: 0, negative: false }];
  const prompt = { kind: 'points', place: { view: 'a.jpg' }, points } as const;
  const thing = thingOf([], { prompt, granularity: {}, answer, samClicks: 'on' });
  if (!thing) throw new Error('the segment is a thing');
  const things = [thing];
  const { signal } = new AbortController();
  await masksOfThings(model, things, views, { progress: () => undefined, signal });
  expect(asked.length).toBeGreaterThan(1);
  for (const { samClicks, samBorders, granularity } of asked) {
    // The contract: not with a scale or a threshold.
    expect([samClicks, samBorders, granularity.threshold]).toEqual([true, undefined, undefined]);
  }
});

test('an export reports each mask that it has made', async () => {
  const steps: [number, number][] = [];
  await exported((done, total) => steps.push([done, total]));
  expect(steps[0]).toEqual([0, 10]);
  expect(steps.at(-1)).toEqual([10, 10]);
  expect(steps.length).toBeGreaterThan(4);
});
