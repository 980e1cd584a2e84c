// Advice of the browser on photographs before they are uploaded.
import { expect, test } from '@playwright/test';
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
import type { DatasetFile } from '../../app/upload/dataset_files';
import { adviceOn } from '../../app/upload/photograph_advice';
import { pixelSizeOf } from '../../app/upload/pixel_size';
import { isSample, sampleOf } from '../../app/screens/sample_scene';

const big = (value: number) => [value >> 8, value & 0xff];

/** A JPEG's header, with a segment of `before` bytes before its size. */
function jpeg(width: number, height: number, before = 4): Blob {
  const segment = [0xff, 0xe1, ...big(before + 2), ...new Array<number>(before).fill(0xc0)];
  const frame = [0xff, 0xc2, ...big(17), 8, ...big(height), ...big(width), 3, 0, 0, 0];
  return new Blob([new Uint8Array([0xff, 0xd8, ...segment, ...frame])]);
}

function png(width: number, height: number): Blob {
  const signature = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];
  const sides = [width, height].flatMap((side) => [0, 0, ...big(side)]);
  return new Blob([new Uint8Array([...signature, 0, 0, 0, 13, ...Buffer.from('IHDR'), ...sides])]);
}

function photographs(...files: Blob[]): DatasetFile[] {
  return files.map((file, i) => ({
    path: `images/${i}.jpg`,
    kind: FileKind.IMAGE,
    file: file as File,
  }));
}

/** Photographs of which no two are equal, and none is of another's length. */
function many(count: number): Blob[] {
  return Array.from({ length: count }, (_, i) => jpeg(4000, 3000, 10 + i));
}

let numDigested = 0;
const digest = async (file: Blob) => {
  numDigested += 1;
  return Buffer.from(await file.arrayBuffer()).toString('hex');
};

test('the size of a photograph is in its header', async () => {
  expect(await pixelSizeOf(jpeg(4032, 3024))).toEqual({ width: 4032, height: 3024 });
  expect(await pixelSizeOf(jpeg(640, 480, 60_000))).toEqual({ width: 640, height: 480 });
  expect(await pixelSizeOf(png(800, 600))).toEqual({ width: 800, height: 600 });
  expect(await pixelSizeOf(new Blob(['RIFF....WEBPVP8 ']))).toBeUndefined();
  expect(await pixelSizeOf(jpeg(640, 480).slice(0, 12))).toBeUndefined();
  expect(await pixelSizeOf(new Blob([]))).toBeUndefined();
});

test('good photographs get no advice, and are not read whole', async () => {
  numDigested = 0;
  expect(await adviceOn(photographs(...many(10)), digest)).toEqual([]);
  expect(numDigested).toBe(0);
});

test('few, equal and small photographs are named', async () => {
  const [few] = await adviceOn(photographs(...many(9)), digest);
  expect(few).toContain('Only 9 photographs');
  // Too few to train are a fault of the dataset, not advice.
  expect(await adviceOn(photographs(...many(2)), digest)).toEqual([]);

  const twice = photographs(...many(10), jpeg(4000, 3000, 12), jpeg(4001, 3000, 13));
  numDigested = 0;
  expect(await adviceOn(twice, digest)).toEqual(['Copies of other photographs, which add nothing: images/10.jpg.']);
  expect(numDigested, 'those of equal length').toBe(4);

  const small = photographs(...many(10), jpeg(639, 480, 90), png(480, 640));
  const advice = await adviceOn(small, digest);
  expect(advice).toHaveLength(1);
  expect(advice[0]).toMatch(/^Smaller than 640 pixels.*: images\/10\.jpg\.$/);
});

test('a video is enough', async () => {
  const video = { path: 'videos/a.mp4', kind: FileKind.VIDEO, file: new Blob(['ftyp']) as File };
  expect(await adviceOn([video, ...photographs(...many(4))], digest)).toEqual([]);
});

test('the sample is the scene of make demo, once it has a model', () => {
  const scene = (id: string, liveModel = '') => ({ name: `scenes/${id}`, liveModel }) as never;
  expect(['demo', 'demo-2', 'demonstration', 'demo-a'].map((id) => isSample(scene(id)))).toEqual([
    true,
    true,
    false,
    false,
  ]);
  const trained = scene('demo-2', 'scenes/demo-2/models/1');
  expect(sampleOf([scene('shelf', 'scenes/shelf/models/1'), scene('demo'), trained])).toBe(trained);
  expect(sampleOf([scene('demo')])).toBeUndefined();
});
