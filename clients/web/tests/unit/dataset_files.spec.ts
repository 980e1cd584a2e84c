import { expect, test } from '@playwright/test';
import type { DroppedFile } from '../../app/upload/dataset_files';
import { describe, kindOf, readDataset, sceneIdFrom } from '../../app/upload/dataset_files';
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';

function dropped(...paths: string[]): DroppedFile[] {
  return paths.map((path) => ({ path, file: new Blob([path]) as File }));
}

test('the layout of the command-line client', () => {
  expect(kindOf('images/a/0001.JPG')).toBe(FileKind.IMAGE);
  expect(kindOf('images/IMG_0001.HEIC')).toBe(FileKind.IMAGE);
  expect(kindOf('images/walk.mp4')).toBe(FileKind.VIDEO);
  expect(kindOf('sparse/0/cameras.bin')).toBe(FileKind.POSES);
  expect(kindOf('sparse/points3D.txt')).toBe(FileKind.POINTS);
  expect(kindOf('sparse/1/cameras.bin')).toBe(FileKind.POSES);
  expect(kindOf('sparse/x/cameras.bin')).toBeUndefined();
  expect(kindOf('masks/0001.json')).toBe(FileKind.MASK);
  expect(kindOf('depth/0001.npy')).toBe(FileKind.DEPTH);
  expect(kindOf('disparity/0001.pfm')).toBe(FileKind.DISPARITY);
  expect(kindOf('gaussians.ply')).toBe(FileKind.GAUSSIANS);
  expect(kindOf('labels/0001.png')).toBeUndefined();
});

test('a dropped folder is the scene', () => {
  const { files, leftOut } = readDataset(
    dropped('shelf/images/b.jpg', 'shelf/images/a.jpg', 'shelf/LICENSE'),
  );
  expect(files.map(({ path }) => path)).toEqual(['images/a.jpg', 'images/b.jpg']);
  expect(leftOut).toEqual(['LICENSE']);
});

test('a folder of photographs alone', () => {
  const { files } = readDataset(dropped('holiday/1.jpg', 'holiday/2.png', 'holiday/notes.txt'));
  expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'images/2.png']);
});

test('loose files and a video', () => {
  const { files } = readDataset(dropped('walk.mp4', '.DS_Store'));
  expect(files.map(({ path, kind }) => [path, kind])).toEqual([
    ['videos/walk.mp4', FileKind.VIDEO],
  ]);
});

test('files that systems add, and the videos of Live Photos, are left out', () => {
  const { files, leftOut } = readDataset(
    dropped(
      'trip/IMG_1.HEIC',
      'trip/IMG_1.MOV',
      'trip/walk.mov',
      'trip/._IMG_1.jpg',
      'trip/__MACOSX/a.jpg',
      'trip/@eaDir/IMG_1.jpg',
      'trip/Thumbs.db',
    ),
  );
  expect(files.map(({ path }) => path)).toEqual(['images/IMG_1.HEIC', 'videos/walk.mov']);
  expect(leftOut).toEqual(['videos/IMG_1.MOV']);
});

test('the folder "images" by itself', () => {
  const { files } = readDataset(dropped('images/1.jpg', 'images/2.jpg'));
  expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'images/2.jpg']);
});

test('the summary counts files by kind', () => {
  expect(
    describe([{ kind: FileKind.IMAGE }, { kind: FileKind.POSES }, { kind: FileKind.IMAGE }]),
  ).toBe('2 photographs, 1 file of poses');
});

test('ids of scenes come from folder names', () => {
  for (const name of ['llff_horns', 'Fern-2', '42', 'v1.0']) expect(sceneIdFrom(name)).toBe(name);
  expect(sceneIdFrom('Küche & Regal (2)')).toBe('Kuche-Regal-2');
  expect(sceneIdFrom('../.hidden')).toBe('hidden');
  expect(sceneIdFrom('x'.repeat(80))).toMatch(/^[A-Za-z0-9][\w.-]{0,62}$/);
  expect(sceneIdFrom('日本')).toBe('scene');
});
