// The versions of a scene, and the views that they share.
import { create } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import { ModelSchema, ViewSchema } from '../../gen/pepeseg/v1/scene_service_pb';
import { replace } from './fake_session';

const scene = 'scenes/shelf';
const nameOf = (number: number) => `${scene}/models/${number}`;
const modelOf = (number: number, made: object = {}) =>
  create(ModelSchema, { name: nameOf(number), ...made });
const list = [
  modelOf(5, { correctedFrom: nameOf(4) }),
  modelOf(4, { editedFrom: nameOf(2), edit: 'moved 12 Gaussians' }),
  modelOf(3, { correctedFrom: nameOf(1) }),
  modelOf(2, { editedFrom: nameOf(1) }),
  modelOf(1),
];

test.beforeEach(() => {
  Object.assign(globalThis, { window: new EventTarget() });
});
test.afterEach(() => {
  Reflect.deleteProperty(globalThis, 'window');
});

test('a version says what made it, and whether photographs show it', async () => {
  const { isEdited, versionText } = await import('../../app/edit/versions');
  expect(list.map(versionText)).toEqual([
    'Corrected segments',
    'Moved 12 Gaussians',
    'Corrected segments',
    'Edited',
    'Training',
  ]);
  expect(list.map(({ name }) => isEdited(list, name))).toEqual([true, true, false, true, false]);
  expect(isEdited(list, nameOf(9))).toBe(false);
  // The version that it was made from was deleted.
  expect(isEdited([modelOf(5, { correctedFrom: nameOf(4) })], nameOf(5))).toBe(false);
});

test('versions are listed and deleted; a refusal is a failure', async () => {
  const { scenes } = await import('../../app/api/clients');
  const { SceneVersions } = await import('../../app/edit/versions');
  let models = list;
  const putBack = replace(scenes, {
    listModels: async ({ parent }: { parent: string }) => {
      if (parent !== scene) throw new Error('no such scene');
      return { models, nextPageToken: '' };
    },
    deleteModel: async ({ name }: { name: string }) => {
      models = models.filter((other) => other.name !== name);
    },
  });
  const versions = new SceneVersions(scene);
  await versions.load();
  await versions.remove(nameOf(3));
  expect(versions.state.get().list.map(({ name }) => name)).toEqual([5, 4, 2, 1].map(nameOf));
  const other = new SceneVersions('scenes/other');
  await other.load();
  expect(other.state.get().failure?.what).toBe('No such scene.');
  putBack();
});

test('views that differ by their scores only are the same', async () => {
  const { sameViews } = await import('../../app/screens/model_views');
  const viewOf = (view: string, fx: number, psnr?: number) =>
    create(ViewSchema, { view, camera: { width: 4, fx }, ...(psnr && { scores: { psnr } }) });
  const views = [viewOf('a.jpg', 1, 20), viewOf('b.jpg', 2)];
  expect(sameViews(views, [viewOf('a.jpg', 1), viewOf('b.jpg', 2)])).toBe(true);
  expect(sameViews(views, [viewOf('a.jpg', 3), viewOf('b.jpg', 2)])).toBe(false);
  expect(sameViews(views, [viewOf('b.jpg', 2), viewOf('a.jpg', 1)])).toBe(false);
  expect(sameViews(views, views.slice(0, 1))).toBe(false);
});
