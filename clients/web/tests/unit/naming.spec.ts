import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import type { FakeSession } from './fake_session';
import { answerIn, fakeSession, onePixel, replace } from './fake_session';

const undo: (() => void)[] = [];
let named: { text: string; view: string }[];
let deleted: string[];

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { labels, segmentation } = await import('../../app/api/clients');
  named = [];
  deleted = [];
  const createLabel = async ({ label }: { label: { text: string; view: string } }) => {
    named.push({ text: label.text, view: label.view });
    return { name: `scenes/shelf/labels/${label.text}` };
  };
  const deleteLabel = async ({ name }: { name: string }) => void deleted.push(name);
  const segmentViews = async ({ targets }: { targets: { views: string[] } }) =>
    answerIn(...targets.views);
  const proposeScales = async () => ({ proposals: [] });
  undo.push(
    replace(labels, { createLabel, deleteLabel, listLabels: async () => ({ labels: [], nextPageToken: '' }) }),
    replace(segmentation, { segmentViews, proposeScales }),
  );
});
test.afterEach(() => {
  for (const back of undo.splice(0).reverse()) back();
  Reflect.deleteProperty(globalThis, 'window');
});

/** Clicks in the first view and names what is there. */
async function clickAndName({ session, answer }: FakeSession, text: string): Promise<void> {
  const { SceneLabels } = await import('../../app/scene/labels');
  const { nameSegment } = await import('../../app/scene/name_segment');
  session.addPoint({ view: 'a.jpg' }, { x: 0.5, y: 0.5, negative: false });
  answer('a.jpg');
  const labels = new SceneLabels('scenes/shelf');
  const mask = labels.maskToName(session.state.get().answer, 'a.jpg');
  if (!mask) throw new Error('nothing to name');
  await nameSegment(session, labels, text, mask);
}

test('two things are named in a row, each by its own click', async () => {
  const fake = await fakeSession();
  await clickAndName(fake, 'Cup');
  expect(fake.session.state.get()).toMatchObject({ prompt: undefined, answer: undefined });
  await clickAndName(fake, 'Book');
  expect(named).toEqual([
    { text: 'Cup', view: 'a.jpg' },
    { text: 'Book', view: 'a.jpg' },
  ]);
  // The second click began a prompt of its own.
  await fake.session.history.undo();
  expect(fake.session.state.get().prompt).toMatchObject({ kind: 'points', points: [{ x: 0.5 }] });
  // The name is one change with the segment's end.
  expect(deleted).toEqual(['scenes/shelf/labels/Book']);
  await fake.session.history.redo();
  expect(named.at(-1)).toEqual({ text: 'Book', view: 'a.jpg' });
  expect(fake.session.state.get().prompt).toBeUndefined();
  fake.session.end();
});

test('a segment whose name the server refuses comes back', async () => {
  const { labels } = await import('../../app/api/clients');
  const refuse = () => Promise.reject(new ConnectError('no', Code.InvalidArgument));
  undo.push(replace(labels, { createLabel: refuse }));
  const fake = await fakeSession();
  await expect(clickAndName(fake, 'Cup')).rejects.toThrow();
  expect(fake.session.state.get().prompt).toMatchObject({ kind: 'points' });
  fake.session.end();
});

test('a deleted label comes back with its mask, and is deleted again', async () => {
  const { labels } = await import('../../app/api/clients');
  const { SceneLabels } = await import('../../app/scene/labels');
  const mask = { image: { case: 'rle', value: onePixel } };
  const label = { name: 'scenes/shelf/labels/cup', text: 'Cup', view: 'b.jpg', mask };
  undo.push(replace(labels, { getLabel: async () => label }));
  const scene = new SceneLabels('scenes/shelf');
  await scene.remove(label as never);
  expect([named, deleted]).toEqual([[], [label.name]]);
  await scene.history.undo();
  expect(named).toEqual([{ text: 'Cup', view: 'b.jpg' }]);
  await scene.history.redo();
  expect(deleted).toEqual([label.name, 'scenes/shelf/labels/Cup']);
});
