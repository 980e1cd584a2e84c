// Edits of a scene's models: what is asked, what is shown then, and their way back.
import { Code, ConnectError } from '@connectrpc/connect';
import { expect, test } from '@playwright/test';
import type { PlannedEdit, SceneEditor } from '../../app/edit/scene_editor';
import type { GaussianEdits } from '../../app/gaussians/gaussian_edits';
import { History } from '../../app/history';
import type { EditModelRequest } from '../../gen/pepeseg/v1/edit_service_pb';
import { model, onePixel, replace } from './fake_session';

const edited = 'scenes/shelf/models/2';
const undo: (() => void)[] = [];
let calls: string[];
let requests: EditModelRequest[];
let history: History;
/** What the stream of an edit does after its first progress. */
let next: (signal: AbortSignal) => Promise<void>;

const progress = (numDone: bigint) => {
  const value = { activity: 'looking behind the thing', numDone, numAll: 4n };
  return { part: { case: 'progress', value } };
};

test.beforeEach(async () => {
  Object.assign(globalThis, { window: new EventTarget() });
  const { editing, scenes, selections } = await import('../../app/api/clients');
  calls = [];
  requests = [];
  history = new History();
  next = async () => undefined;
  undo.push(
    replace(editing, {
      editModel: async function* (request: EditModelRequest, { signal }: { signal: AbortSignal }) {
        requests.push(request);
        yield progress(1n);
        await next(signal);
        const value = { model: edited, editedFrom: model, selection: 'scenes/shelf/selections/9' };
        yield { part: { case: 'result', value } };
      },
    }),
    replace(scenes, {
      setLiveModel: async ({ name }: { name: string }) => {
        calls.push(`live ${name}`);
        return { liveModel: name };
      },
    }),
    replace(selections, {
      createSelection: async ({ source }: { source: { case: string } }) => {
        calls.push(`select ${source.case}`);
        return { name: 'scenes/shelf/selections/7' };
      },
      getSelection: async ({ name }: { name: string }) => {
        calls.push(`get ${name}`);
        return { gaussians: { bits: Uint8Array.of(0b101) } };
      },
      deleteSelection: async ({ name }: { name: string }) => void calls.push(`delete ${name}`),
    }),
  );
});

test.afterEach(() => {
  for (const putBack of undo.splice(0)) putBack();
  Reflect.deleteProperty(globalThis, 'window');
});

async function newEditor(): Promise<SceneEditor> {
  const module = await import('../../app/edit/scene_editor');
  return new module.SceneEditor(history, {
    show: (to) => void calls.push(`show ${to}`),
    changed: () => void calls.push('changed'),
  });
}

const removal: PlannedEdit = {
  name: 'Remove',
  model,
  subject: { kind: 'picked', set: Uint8Array.of(1, 0, 1) },
  edit: { case: 'remove', value: { fill: true } },
  isPicked: false,
};

test('an edit of picks selects them first, and shows the new model', async () => {
  const editor = await newEditor();
  const seen: unknown[] = [];
  editor.task.state.follow(() => seen.push(editor.task.state.get().step));
  expect(await editor.make(removal)).toBe(true);
  expect(requests).toMatchObject([
    {
      model,
      subset: { of: { case: 'selection', value: 'scenes/shelf/selections/7' }, complement: false },
      edit: { case: 'remove', value: { fill: true } },
    },
  ]);
  const done = ['select gaussians', 'delete scenes/shelf/selections/7', `show ${edited}`];
  expect(calls).toEqual(done);
  expect(seen).toContainEqual({ name: 'Looking behind the thing', unit: 'steps', done: 1, total: 4 });
  expect(editor.task.state.get()).toEqual({ step: undefined, failure: undefined });
});

test('undo makes the model before live, redo the new one', async () => {
  const editor = await newEditor();
  await editor.make(removal);
  calls = [];
  expect(history.state.get().undo).toBe('Remove');
  await history.undo();
  expect(calls).toEqual([`live ${model}`, `show ${model}`]);
  await history.redo();
  expect(calls.slice(2)).toEqual([`live ${edited}`, `show ${edited}`]);
});

test('a segment of everything is edited without a selection, and all but it removed', async () => {
  const editor = await newEditor();
  const segment = { level: 1, id: 4 };
  const prompt = {
    kind: 'mask',
    place: { view: 'a.jpg' },
    rle: onePixel,
    isExact: true,
    segment,
  } as const;
  const subject = { kind: 'segment', prompt, granularity: {} } as const;
  await editor.make({ ...removal, subject, complement: true });
  expect(requests[0]?.subset).toMatchObject({ of: { case: 'segment', value: segment }, complement: true });
  expect(calls).toEqual([`show ${edited}`]);
});

test('a click is selected for the edit, a selection stays', async () => {
  const editor = await newEditor();
  const points = [{ x: 1, y: 2, negative: false }];
  const prompt = { kind: 'points', place: { view: 'a.jpg' }, points } as const;
  const subject = { kind: 'segment', prompt, granularity: { scale: 0.5 } } as const;
  await editor.make({ ...removal, subject });
  expect(calls.slice(0, 2)).toEqual(['select prompt', 'delete scenes/shelf/selections/7']);
  calls = [];
  await editor.make({ ...removal, subject: { kind: 'selection', selection: 'scenes/shelf/selections/3' } });
  expect(requests[1]?.subset).toMatchObject({ of: { value: 'scenes/shelf/selections/3' } });
  expect(calls).toEqual([`show ${edited}`]);
});

test('what was moved is picked in the new model, once', async () => {
  const editor = await newEditor();
  await editor.make({ ...removal, isPicked: true });
  expect(calls).toContain('get scenes/shelf/selections/9');
  expect(editor.takePicks(edited)).toEqual(Uint8Array.of(0b101));
  expect(editor.takePicks(edited)).toBeUndefined();
});

test('an edit that is refused says why, changes nothing and deletes its selection', async () => {
  const editor = await newEditor();
  next = () => Promise.reject(new ConnectError('the subset is empty', Code.InvalidArgument));
  expect(await editor.make(removal)).toBe(false);
  expect(editor.task.state.get().failure?.what).toBe('The subset is empty.');
  expect(calls).toEqual(['select gaussians', 'delete scenes/shelf/selections/7', 'changed']);
  expect(history.state.get().undo).toBeUndefined();
});

test('an edit is not repeated after a lost connection', async () => {
  const editor = await newEditor();
  next = () => Promise.reject(new ConnectError('the connection was lost', Code.Unavailable));
  expect(await editor.make(removal)).toBe(false);
  expect(requests).toHaveLength(1);
  expect(editor.task.state.get().failure?.what).toContain('the versions say whether');
});

test('a cancelled edit ends its call, and is no failure', async () => {
  const editor = await newEditor();
  let wasAborted = false;
  next = (signal) =>
    new Promise((_, reject) => {
      signal.addEventListener('abort', () => {
        wasAborted = true;
        reject(new ConnectError('cancelled', Code.Canceled));
      });
    });
  const making = editor.make(removal);
  await expect.poll(() => editor.task.state.get().step?.done).toBe(1);
  editor.task.cancel();
  expect(await making).toBe(false);
  expect(wasAborted).toBe(true);
  expect(editor.task.state.get()).toEqual({ step: undefined, failure: undefined });
  expect(calls.at(-1), 'the list of versions is asked for again').toBe('changed');
});

test('a segment is picked in 3D to be moved', async () => {
  const editor = await newEditor();
  const bits: Uint8Array[] = [];
  const edits = (numPicked: number) =>
    ({
      pickBits: async (found: Uint8Array) => void bits.push(found),
      state: { get: () => ({ numPicked }) },
    }) as unknown as GaussianEdits;
  const subject = { kind: 'segment', prompt: { kind: 'label', label: 'l' }, granularity: {} } as const;
  expect(await editor.pick(model, subject, edits(2))).toBe(true);
  expect(bits).toEqual([Uint8Array.of(0b101)]);
  expect(calls).toEqual([
    'select prompt',
    'get scenes/shelf/selections/7',
    'delete scenes/shelf/selections/7',
  ]);
  expect(await editor.pick(model, subject, edits(0))).toBe(false);
  expect(editor.task.state.get().failure?.what).toBe('No Gaussians belong to it.');
});

test('another version is a change of the history', async () => {
  const editor = await newEditor();
  await editor.goTo(edited, model);
  expect(calls).toEqual([`live ${edited}`, `show ${edited}`]);
  expect(history.state.get().undo).toBe('Version');
  await history.undo();
  expect(calls.slice(2)).toEqual([`live ${model}`, `show ${model}`]);
});
