import { mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { expect, test } from '@playwright/test';
import { Photographs } from '../../server/photographs';

let folder: string;

test.beforeEach(() => {
  folder = mkdtempSync(join(tmpdir(), 'photographs-'));
});

test.afterEach(() => rmSync(folder, { recursive: true }));

async function textOf(photographs: Photographs, path: string): Promise<string | undefined> {
  const file = await photographs.find('scenes/shelf', path);
  const text = await file?.readFile('utf8');
  await file?.close();
  return text;
}

const upload = 'scenes/shelf/uploads/1';

test('a photograph is there once it has arrived as a whole', async () => {
  const photographs = new Photographs(folder);
  const copy = await photographs.copy(upload, 'images/1.jpg', 0);
  await copy?.add(Buffer.from('abc'));
  expect(await textOf(photographs, 'images/1.jpg')).toBeUndefined();
  await copy?.end(true);
  expect(await textOf(photographs, 'images/1.jpg')).toBe('abc');
  expect(await textOf(photographs, '')).toBe('abc');
});

test('what was cut off goes on at the byte that the server has', async () => {
  const photographs = new Photographs(folder);
  const first = await photographs.copy(upload, 'images/1.jpg', 0);
  await first?.add(Buffer.from('abcdXX'));
  await first?.end(false);
  const second = await photographs.copy(upload, 'images/1.jpg', 4);
  await second?.add(Buffer.from('e'));
  await second?.end(true);
  expect(await textOf(photographs, 'images/1.jpg')).toBe('abcde');
});

test('without its beginning there is no photograph', async () => {
  const photographs = new Photographs(folder);
  expect(await photographs.copy(upload, 'images/1.jpg', 4)).toBeUndefined();
});

test('no path leads out of the folder, nothing but photographs is kept', async () => {
  const photographs = new Photographs(join(folder, 'kept'));
  expect(await photographs.copy('scenes/../uploads/1', 'images/1.jpg', 0)).toBeUndefined();
  expect(await photographs.copy(upload, 'masks/1.png', 0)).toBeUndefined();
  const copy = await photographs.copy(upload, 'images/../../../1.jpg', 0);
  await copy?.end(true);
  expect(readdirSync(folder)).toEqual(['kept']);
  expect(readdirSync(join(folder, 'kept', 'shelf'))).toHaveLength(1);
});

test('scenes whose names differ in case only have folders of their own', async () => {
  const photographs = new Photographs(folder);
  for (const scene of ['Fern_1', 'fern_1', 'fern.1']) {
    const copy = await photographs.copy(`scenes/${scene}/uploads/1`, 'images/1.jpg', 0);
    await copy?.add(Buffer.from(scene));
    await copy?.end(true);
  }
  expect(readdirSync(folder).sort()).toEqual(['_fern__1', 'fern_-1', 'fern__1']);
  const file = await photographs.find('scenes/Fern_1', 'images/1.jpg');
  expect(await file?.readFile('utf8')).toBe('Fern_1');
  await file?.close();
});

test('a scene that is deleted is forgotten', async () => {
  const photographs = new Photographs(folder);
  const copy = await photographs.copy(upload, 'images/1.jpg', 0);
  await copy?.add(Buffer.from('abc'));
  await copy?.end(true);
  const [kept = ''] = readdirSync(join(folder, 'shelf'));
  expect(readFileSync(join(folder, 'shelf', kept), 'utf8')).toBe('abc');
  await photographs.forget('scenes/shelf');
  expect(readdirSync(folder)).toEqual([]);
});
