// Gaussians of a PLY, sets of them, and those inside an outline.
import { expect, test } from '@playwright/test';
import { PerspectiveCamera, Matrix4 } from 'three';
import { centersOf, indicesIn, plyOf, readGaussianPly } from '../../app/gaussians/gaussian_ply';
import { bitsOf, combined, complementOf, setOfBits, sizeOfSet } from '../../app/gaussians/gaussian_set';
import type { Sight } from '../../app/gaussians/pick';
import { inChunks } from '../../app/gaussians/in_chunks';
import { inFrontOf, pickInside } from '../../app/gaussians/pick';
import { outlined } from '../../app/mask/edit_mask';
import { decodeRle } from '../../app/mask/rle';
import type { Gaussian } from './gaussian_plys';
import { plyWith } from './gaussian_plys';

const three: Gaussian[] = [
  { center: [1, 2, 3], size: 0.5, opacity: 0.25 },
  { center: [4, 5, 6] },
  { center: [7, 8, 9.5] },
];

for (const isDouble of [false, true]) {
  test(`a PLY with ${isDouble ? 'doubles' : 'floats'} is read`, () => {
    const { count, centers, sizes, opacities, luminances } = readGaussianPly(plyWith(three, isDouble));
    expect(count).toBe(3);
    expect([...centers]).toEqual([1, 2, 3, 4, 5, 6, 7, 8, 9.5]);
    expect(sizes[0]).toBeCloseTo(0.5, 6);
    expect(opacities[0]).toBeCloseTo(0.25, 6);
    // Their red grows with their index; above 1 it stays 1.
    const reds = [0.5, 0.5 + 0.28209479, 1];
    for (const [i, red] of reds.entries()) {
      expect(luminances[i]).toBeCloseTo(0.2126 * red + 0.7152 * 0.5 + 0.0722 * 0.5, 6);
    }
  });

  test(`a PLY of some Gaussians has their records, with ${isDouble ? 'doubles' : 'floats'}`, async () => {
    const whole = plyWith(three, isDouble);
    const part = await (await plyOf(new Blob([whole]), Uint8Array.of(1, 0, 1))).arrayBuffer();
    const [a, , c] = three as [Gaussian, Gaussian, Gaussian];
    expect([...(await centersOf(part))]).toEqual([...a.center, ...c.center]);
    const text = Buffer.from(part).toString('latin1');
    expect(text).toContain('element vertex 2\n');
    const records = Buffer.from(whole).subarray(-3 * (isDouble ? 52 : 40));
    const stride = records.length / 3;
    const kept = Buffer.concat([records.subarray(0, stride), records.subarray(2 * stride)]);
    expect(Buffer.from(part).subarray(-2 * stride).equals(kept)).toBe(true);
  });
}

test('a large PLY keeps its order over the pieces in which it is copied', async () => {
  const many = Array.from({ length: 40_000 }, (_, i): Gaussian => ({ center: [i, 0, 0] }));
  const odd = new Uint8Array(many.length).map((_, i) => i % 2);
  const part = await centersOf(await (await plyOf(new Blob([plyWith(many)]), odd)).arrayBuffer());
  expect(part).toHaveLength(3 * 20_000);
  expect([part[0], part[3 * 9000], part[3 * 19_999]]).toEqual([1, 18_001, 39_999]);
});

test('files that are not PLYs of Gaussians, and cut ones, are refused', () => {
  expect(() => readGaussianPly(new TextEncoder().encode('solid cube').buffer)).toThrow('not a PLY');
  expect(() => readGaussianPly(plyWith(three).slice(0, -1))).toThrow('cut off');
});

test('the Gaussians of a part are found in the model, equal ones in their order', () => {
  const all = Float32Array.of(0, 0, 0, 1, 1, 1, 1, 1, 1, NaN, 2, 2, 3, 3, 3);
  expect([...indicesIn(all, all)]).toEqual([0, 1, 2, 3, 4]);
  expect([...indicesIn(all, Float32Array.of(1, 1, 1, NaN, 2, 2, 3, 3, 3))]).toEqual([1, 3, 4]);
  expect(() => indicesIn(all, Float32Array.of(5, 5, 5))).toThrow('the model has not');
});

test('sets become bits and bits sets', () => {
  const set = Uint8Array.from({ length: 11 }, (_, i) => Number(i === 0 || i === 3 || i === 9));
  expect([...bitsOf(set)]).toEqual([0b0000_1001, 0b0000_0010]);
  expect([...setOfBits(bitsOf(set), 11)]).toEqual([...set]);
  expect(() => setOfBits(Uint8Array.of(1), 11)).toThrow('not the bits of 11 Gaussians');
});

test('sets are combined', () => {
  const base = Uint8Array.of(1, 1, 0, 0);
  const found = Uint8Array.of(1, 0, 1, 0);
  expect([...combined(base, found, 'replace')]).toEqual([1, 0, 1, 0]);
  expect([...combined(base, found, 'add')]).toEqual([1, 1, 1, 0]);
  expect([...combined(base, found, 'subtract')]).toEqual([0, 1, 0, 0]);
  expect([...base], 'sets do not change').toEqual([1, 1, 0, 0]);
  expect([...complementOf(base)]).toEqual([0, 0, 1, 1]);
  expect(sizeOfSet(base)).toBe(2);
});

/** A camera at the origin that looks along -z, as three.js has it. */
function sightOf(width: number, height: number): Sight {
  const camera = new PerspectiveCamera(90, width / height, 0.01, 1000);
  camera.updateMatrixWorld();
  const matrix = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  return { matrix: matrix.elements, width, height };
}

test('what is inside the outline is picked through the depth, but not behind the camera', async () => {
  const gaussians = readGaussianPly(
    plyWith([
      { center: [0, 0, -1] },
      { center: [0.01, 0.01, -50] },
      { center: [0, 0, 1] },
      { center: [0.9, 0, -1] },
      { center: [0, 0.6, -1] },
      { center: [3, 0, -1] },
    ]),
  );
  const sight = sightOf(100, 100);
  const all = new Uint8Array(6).fill(1);
  const inside = (...corners: [number, number][]) =>
    decodeRle(outlined(corners.map(([x, y]) => ({ x, y })), 100, 100));
  const middle = inside([40, 40], [60, 40], [60, 60], [40, 60]);
  expect([...(await pickInside(gaussians, sight, middle, all))]).toEqual([1, 1, 0, 0, 0, 0]);
  // y of the screen goes down: the fifth is above the middle, at 20.
  const upper = inside([50, 10], [60, 30], [40, 30]);
  expect([...(await pickInside(gaussians, sight, upper, all))]).toEqual([0, 0, 0, 0, 1, 0]);
  const right = inside([90, 40], [300, 40], [300, 60], [90, 60]);
  expect([...(await pickInside(gaussians, sight, right, all))]).toEqual([0, 0, 0, 1, 0, 0]);
  const some = Uint8Array.of(0, 1, 1, 1, 1, 1);
  expect([...(await pickInside(gaussians, sight, middle, some))]).toEqual([0, 1, 0, 0, 0, 0]);
});

test('in front is what is at most a twentieth behind the nearest opaque Gaussian', async () => {
  const gaussians = readGaussianPly(
    plyWith([
      { center: [0, 0, -0.5], opacity: 0.1 },
      { center: [0, 0, -1] },
      { center: [0, 0, -1.04] },
      { center: [0, 0, -1.1] },
      { center: [3, 0, -7] },
    ]),
  );
  const all = new Uint8Array(5).fill(1);
  expect([...(await inFrontOf(gaussians, sightOf(100, 100), all, all))]).toEqual([1, 1, 1, 0, 1]);
  // What is not shown hides nothing.
  const shown = Uint8Array.of(0, 0, 0, 1, 1);
  expect([...(await inFrontOf(gaussians, sightOf(100, 100), shown, shown))]).toEqual([0, 0, 0, 1, 1]);
});

test('work in chunks covers all Gaussians in their order, and lets other tasks run in between', async () => {
  const count = 200_000;
  let next = 0;
  let time = 0;
  let numTurns = 0;
  const others = setInterval(() => (numTurns += 1), 0);
  await inChunks(
    count,
    (first, last) => {
      expect(first).toBe(next);
      next = last;
      time += 15;
      // A busy thread: a timer is due at each turn.
      for (const end = performance.now() + 2; performance.now() < end;);
    },
    () => time,
  );
  clearInterval(others);
  expect(next).toBe(count);
  // 13 chunks of 15 ms, and a turn after each 40 ms.
  expect(numTurns).toBeGreaterThanOrEqual(3);

  numTurns = 0;
  const none = setInterval(() => (numTurns += 1), 0);
  await inChunks(count, () => undefined, () => 0);
  clearInterval(none);
  expect(numTurns, 'quick work takes no turns').toBe(0);
});
