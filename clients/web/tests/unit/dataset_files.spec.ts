import { expect, test } from '@playwright/test';
import type { DroppedFile } from '../../app/upload/dataset_files';
import { readDataset } from '../../app/upload/dataset_files';
import { inLayout, isReadableName, kindOf } from '../../app/upload/dataset_layout';
import { describe } from '../../app/upload/dataset_summary';
import { verdictOf } from '../../app/upload/dataset_verdict';
import { sceneIdFrom } from '../../app/upload/scene_id';
import { transformsReferences } from '../../app/upload/transforms_references';
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';

/** Returns a file whose content is what its name says, as far as its first bytes go. */
function fileNamed(path: string): File {
  const beginnings: readonly [RegExp, number[]][] = [
    [/\.png$/i, [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]],
    [/\.jpe?g$/i, [0xff, 0xd8, 0xff, 0xe0]],
    [/\.heic$/i, [0, 0, 0, 24, ...Buffer.from('ftypheic')]],
    [/\.(mp4|mov)$/i, [0, 0, 0, 24, ...Buffer.from('ftypisom')]],
  ];
  const bytes = beginnings.find(([name]) => name.test(path))?.[1] ?? [...Buffer.from(path)];
  return new Blob([new Uint8Array(bytes)]) as File;
}

function dropped(...paths: string[]): DroppedFile[] {
  return paths.map((path) => ({ path, file: fileNamed(path) }));
}

function transforms(document: object): DroppedFile {
  const text = JSON.stringify(document);
  return { path: 'shop/transforms.json', file: new Blob([text]) as File };
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

test('a dropped folder is the scene', async () => {
  const { files, leftOut } = await readDataset(
    dropped('shelf/images/b.jpg', 'shelf/images/a.jpg', 'shelf/LICENSE'),
  );
  expect(files.map(({ path }) => path)).toEqual(['images/a.jpg', 'images/b.jpg']);
  expect(leftOut).toEqual(['LICENSE']);
});

test('a folder of photographs alone', async () => {
  const { files } = await readDataset(
    dropped('holiday/1.jpg', 'holiday/2.png', 'holiday/notes.txt'),
  );
  expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'images/2.png']);
});

test('loose files and a video', async () => {
  const { files } = await readDataset(dropped('walk.mp4', '.DS_Store'));
  expect(files.map(({ path, kind }) => [path, kind])).toEqual([
    ['videos/walk.mp4', FileKind.VIDEO],
  ]);
});

test('files that systems add, and the videos of Live Photos, are left out', async () => {
  const { files, leftOut } = await readDataset(
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

test('a video with the name of a photograph in another folder is not a Live Photo', async () => {
  const { files } = await readDataset(dropped('trip/images/walk.jpg', 'trip/videos/walk.mp4'));
  expect(files.map(({ path }) => path)).toEqual(['images/walk.jpg', 'videos/walk.mp4']);
});

test('the folder "images" by itself', async () => {
  const { files } = await readDataset(dropped('images/1.jpg', 'images/2.jpg'));
  expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'images/2.jpg']);
});

test('letters of the layout’s folders may be upper case', async () => {
  for (const folder of ['Images', 'IMAGES', 'images']) {
    const read = await readDataset(
      dropped(
        `shelf/${folder}/a.jpg`,
        'shelf/Masks/a.png',
        'shelf/DEPTH/a.npy',
        'shelf/Sparse/0/cameras.bin',
      ),
    );
    expect(read.files.map(({ path, kind }) => [path, kind])).toEqual([
      ['depth/a.npy', FileKind.DEPTH],
      ['images/a.jpg', FileKind.IMAGE],
      ['masks/a.png', FileKind.MASK],
      ['sparse/0/cameras.bin', FileKind.POSES],
    ]);
    expect(read.leftOut).toEqual([]);
  }
  expect(inLayout('Ignore/Left/A.png')).toBe('ignore/Left/A.png');
  expect(inLayout('Photos/A.png')).toBe('Photos/A.png');
  expect(inLayout('Images')).toBe('Images');
});

test('the folder "IMAGES" by itself', async () => {
  const { files } = await readDataset(dropped('IMAGES/1.jpg', 'IMAGES/2.jpg'));
  expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'images/2.jpg']);
});

test('the scene may be the only folder inside, up to four deep', async () => {
  for (const inside of ['garden', 'a/b/c/garden']) {
    const { files } = await readDataset(
      dropped(
        `download/${inside}/Images/1.jpg`,
        `download/${inside}/masks/1.png`,
        'download/.DS_Store',
      ),
    );
    expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'masks/1.png']);
  }
  const tooDeep = await readDataset(dropped('download/a/b/c/d/e/images/1.jpg'));
  expect(tooDeep.files).toEqual([]);
  const { files, leftOut } = await readDataset(
    dropped('two/one/images/1.jpg', 'two/other/notes.txt'),
  );
  expect(files).toEqual([]);
  expect(leftOut).toEqual(['one/images/1.jpg', 'other/notes.txt']);
});

test('photographs in other folders are not taken, and the page says where they are', async () => {
  const read = await readDataset(dropped('shop/rgb/2.jpg', 'shop/rgb/1.jpg', 'shop/seg/1.png'));
  expect(read.files).toEqual([]);
  expect(read.picturesElsewhere).toBe('rgb');
  const { canUpload, faults } = verdictOf(read);
  expect(canUpload).toBe(false);
  expect(faults).toHaveLength(1);
  expect(faults[0]).toContain('There are some in rgb/: drop that folder, or rename it to images.');
  // Folders next to photographs are not looked for.
  const some = await readDataset(dropped('shop/images/1.jpg', 'shop/rgb/1.jpg'));
  expect([some.picturesElsewhere, some.leftOut]).toEqual([undefined, ['rgb/1.jpg']]);
  const loose = await readDataset(dropped('shop/1.jpg', 'shop/rgb/2.jpg'));
  expect(loose.files.map(({ path }) => path)).toEqual(['images/1.jpg']);
});

test('files whose names are not UTF-8 are left out, and named', async () => {
  const read = await readDataset(
    dropped('trip/1.jpg', 'trip/2.jpg', 'trip/3.jpg', 'trip/k\ufffdche.jpg', 'trip/._k\ufffd.jpg'),
  );
  expect(read.files).toHaveLength(3);
  expect(read.unreadableNames).toEqual(['trip/k\ufffdche.jpg']);
  const { tone, canTrain, faults } = verdictOf(read);
  expect([tone, canTrain]).toEqual(['bad', true]);
  expect(faults).toEqual([
    'Left out, because the name is not UTF-8; rename the file: trip/k\ufffdche.jpg.',
  ]);
  for (const name of ['a\ud83d.jpg', '\ude00.jpg', 'a//b.jpg', ''])
    expect(isReadableName(name)).toBe(false);
  for (const name of ['küche/日本 1.jpg', '😀.jpg']) expect(isReadableName(name)).toBe(true);
});

test('masks that transforms.json names are not photographs, and its points are taken', async () => {
  const document = {
    ply_file_path: './cloud/dense.ply',
    mask_path: 'car.png',
    frames: [
      { file_path: 'images/1.jpg', mask_path: 'keep/1.png' },
      { file_path: 'images/2.jpg', mask_path: '..\\keep\\2.png' },
      { file_path: 'images/3.jpg', mask_path: 7 },
    ],
  };
  const files = dropped(
    'images/1.jpg',
    'images/2.jpg',
    'keep/1.png',
    'keep/2.png',
    'keep/9.txt',
    'car.png',
  );
  const read = await readDataset([
    transforms(document),
    ...[...files, ...dropped('cloud/dense.ply')].map(({ path, file }) => ({
      path: `shop/${path}`,
      file,
    })),
  ]);
  expect(read.files.map(({ path, kind }) => [path, kind])).toEqual([
    ['car.png', FileKind.MASK],
    ['cloud/dense.ply', FileKind.POINTS],
    ['images/1.jpg', FileKind.IMAGE],
    ['images/2.jpg', FileKind.IMAGE],
    ['keep/1.png', FileKind.MASK],
    ['keep/2.png', FileKind.MASK],
    ['transforms.json', FileKind.POSES],
  ]);
  expect(read.leftOut).toEqual(['keep/9.txt']);
});

test('a transforms.json may begin with a byte order mark', async () => {
  const text = `\ufeff${JSON.stringify({ ply_file_path: 'cloud.ply' })}`;
  const file = new Blob([text]) as File;
  const read = await readDataset([
    { path: 'transforms.json', file },
    ...dropped('images/1.jpg', 'cloud.ply'),
  ]);
  expect(read.files.map(({ path }) => path)).toEqual([
    'cloud.ply',
    'images/1.jpg',
    'transforms.json',
  ]);
  expect([...transformsReferences(text)]).toEqual([['cloud.ply', FileKind.POINTS]]);
});

test('masks that transforms.json names are ignore masks in the summary', async () => {
  const document = { frames: [{ mask_path: 'masks/1.png' }, { mask_path: 'keep/2.png' }] };
  const names = ['images/1.jpg', 'images/2.jpg', 'masks/1.png', 'keep/2.png', 'masks/2.json'];
  const { files } = await readDataset([
    transforms(document),
    ...dropped(...names.map((name) => `shop/${name}`)),
  ]);
  expect(describe(files)).toBe('2 photographs, 1 file of poses, 1 file of masks, 2 ignore masks');
  expect(files.filter(({ ignores }) => ignores).map(({ path, kind }) => [path, kind])).toEqual([
    ['keep/2.png', FileKind.MASK],
    ['masks/1.png', FileKind.MASK],
  ]);
});

test('points without bytes are left out, wherever they are', async () => {
  const empty = (path: string) => ({ path, file: new Blob([]) as File });
  const { files, leftOut } = await readDataset([
    { path: 'transforms.json', file: transforms({ ply_file_path: 'cloud.ply' }).file },
    ...dropped('images/1.jpg'),
    empty('sparse/0/points3D.bin'),
    empty('cloud.ply'),
  ]);
  expect(files.map(({ path }) => path)).toEqual(['images/1.jpg', 'transforms.json']);
  expect(leftOut).toEqual(['cloud.ply', 'sparse/0/points3D.bin']);
});

test('a mask that transforms.json names next to loose photographs is not one of them', async () => {
  const { files } = await readDataset([
    { path: 'transforms.json', file: transforms({ mask_path: 'car.png' }).file },
    ...dropped('1.jpg', '2.jpg', 'car.png'),
  ]);
  expect(files.map(({ path, kind }) => [path, kind])).toEqual([
    ['car.png', FileKind.MASK],
    ['images/1.jpg', FileKind.IMAGE],
    ['images/2.jpg', FileKind.IMAGE],
    ['transforms.json', FileKind.POSES],
  ]);
});

test('a mask that transforms.json names in images/ is not a photograph', async () => {
  const document = {
    frames: [
      { file_path: 'images/a.jpg', mask_path: 'images/a_mask.png' },
      { file_path: 'images/b.jpg', mask_path: 'keep/B.png' },
    ],
  };
  const names = ['images/a.jpg', 'images/a_mask.png', 'images/b.jpg', 'keep/b.png'];
  const { files, leftOut } = await readDataset([
    transforms(document),
    ...dropped(...names.map((name) => `shop/${name}`)),
  ]);
  expect(files.map(({ path, kind, ignores }) => [path, kind, ignores ?? false])).toEqual([
    ['images/a.jpg', FileKind.IMAGE, false],
    ['images/a_mask.png', FileKind.MASK, true],
    ['images/b.jpg', FileKind.IMAGE, false],
    ['keep/b.png', FileKind.MASK, true],
    ['transforms.json', FileKind.POSES, false],
  ]);
  expect(leftOut).toEqual([]);
});

test('transforms.json and the folder may differ in the case of letters', async () => {
  const document = {
    ply_file_path: 'Cloud.PLY',
    frames: [{ file_path: 'images/1.jpg', mask_path: 'Images/1_Mask.PNG' }],
  };
  const { files } = await readDataset([
    transforms(document),
    ...dropped('shop/IMAGES/1.jpg', 'shop/IMAGES/1_mask.png', 'shop/cloud.ply'),
  ]);
  expect(files.map(({ path, kind }) => [path, kind])).toEqual([
    ['cloud.ply', FileKind.POINTS],
    ['images/1.jpg', FileKind.IMAGE],
    ['images/1_mask.png', FileKind.MASK],
    ['transforms.json', FileKind.POSES],
  ]);
});

test('a transforms.json that is not an object names no files', async () => {
  for (const text of ['{', '[1]', '7', '{"frames": 3}']) {
    const file = new Blob([text]) as File;
    const read = await readDataset([{ path: 'transforms.json', file }, ...dropped('keep.png')]);
    expect(read.files.map(({ kind }) => kind)).toEqual([FileKind.IMAGE, FileKind.POSES]);
  }
});

test('a file that is not a photograph is left out, and named', async () => {
  const fake = { path: 'images/notes.jpg', file: new Blob(['dear diary']) as File };
  const read = await readDataset([
    ...dropped('images/1.jpg', 'images/2.jpg', 'images/3.jpg'),
    fake,
  ]);
  expect(read.files).toHaveLength(3);
  expect(read.notPictures).toEqual(['images/notes.jpg']);
  const { tone, canTrain, faults } = verdictOf(read);
  expect([tone, canTrain]).toEqual(['bad', true]);
  expect(faults.join()).toContain('images/notes.jpg');
});

test('too few photographs get no green tick, and cannot be trained', async () => {
  const verdict = async (...paths: string[]) => {
    const { tone, canUpload, canTrain } = verdictOf(await readDataset(dropped(...paths)));
    return [tone, canUpload, canTrain];
  };
  expect(await verdict('images/1.jpg')).toEqual(['bad', true, false]);
  expect(await verdict('images/1.jpg', 'images/2.jpg')).toEqual(['bad', true, false]);
  expect(await verdict('images/1.jpg', 'sparse/0/images.bin')).toEqual(['bad', true, false]);
  expect(await verdict('notes.txt')).toEqual(['bad', false, false]);
  expect(await verdict('images/1.jpg', 'images/2.jpg', 'images/3.jpg')).toEqual([
    'good',
    true,
    true,
  ]);
  const posed = ['images/1.jpg', 'images/2.jpg', 'sparse/0/images.bin'];
  expect(await verdict(...posed)).toEqual(['good', true, true]);
  expect(await verdict('walk.mp4')).toEqual(['good', true, true]);
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
