// The crop box, and which Gaussians are floaters.
import { expect, test } from '@playwright/test';
import { Ray, Vector3 } from 'three';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { boxAround, withFace, withOutside } from '../../app/gaussians/crop_box';
import { floatersAmong, reachOfNeighbours } from '../../app/gaussians/floaters';
import { sightsOf } from '../../app/gaussians/sights';
import { nearestAlong } from '../../app/viewer/crop_handles';

/** Returns Gaussians on a grid of a plane, at z = 0, and others. */
function plane(others: readonly [number, number, number][], size = 0.001, side = 100) {
  const points = Array.from({ length: side * side }, (_, i) => [
    (i % side) / side,
    Math.floor(i / side) / side,
    0,
  ]);
  const all = [...points, ...others];
  return { centers: Float32Array.from(all.flat()), sizes: new Float32Array(all.length).fill(size) };
}

const onPlane = 100 * 100;

test('a Gaussian that is far from all others is a floater, and so is a small group', () => {
  const near = reachOfNeighbours(plane([]).centers) / 2;
  const scene = plane([
    [0.5, 0.5, 0.5],
    [0.5, 0.5, near],
    [3, 3, 3],
    [3.001, 3, 3],
    [1e9, 0, 0],
  ]);
  const floaters = floatersAmong(scene, []);
  expect([...floaters.subarray(onPlane)]).toEqual([1, 0, 1, 1, 1]);
  expect(floaters.subarray(0, onPlane).indexOf(1), 'the plane stays').toBe(-1);
});

test('a Gaussian that is as large as its reach is not a floater for being alone', () => {
  const scene = plane([[0.5, 0.5, 0.5]]);
  scene.sizes[onPlane] = 1.01 * reachOfNeighbours(scene.centers);
  expect(floatersAmong(scene, [])[onPlane]).toBe(0);
});

/** A camera at z = -1 that looks along z, 90 degrees wide and 53 high. */
const view = {
  camera: { width: 200, height: 100, fx: 100, fy: 100, cx: 100, cy: 50 },
  camFromWorld: { rotation: { w: 1, x: 0, y: 0, z: 0 }, translation: { x: -0.5, y: -0.5, z: 1 } },
} as unknown as View;

test('what no photograph shows is a floater, with a margin at its border', () => {
  const group = (x: number, y: number, z: number) =>
    Array.from({ length: 8 }, (_, i): [number, number, number] => [x, y, z + 1e-4 * i]);
  const scene = plane([...group(0.5, 0.5, -2), ...group(1.65, 0.5, 0), ...group(1.75, 0.5, 0)]);
  expect(floatersAmong(scene, []).subarray(onPlane).includes(1), 'groups are not alone').toBe(false);
  const floaters = floatersAmong(scene, sightsOf([view]));
  const groups = [0, 8, 16].map((at) => floaters[onPlane + at]);
  expect(groups, 'behind the camera, in the margin, outside').toEqual([1, 0, 1]);
  expect(floaters[0], 'all of the plane is seen').toBe(0);
});

test('a rotated camera sees along its own axis', () => {
  // A turn of 90 degrees about y: the camera looks along -x of the world.
  const half = Math.SQRT1_2;
  const turned = {
    camera: { width: 200, height: 200, fx: 100, fy: 100, cx: 100, cy: 100 },
    camFromWorld: { rotation: { w: half, x: 0, y: half, z: 0 }, translation: { x: 0, y: 0, z: 0 } },
  } as unknown as View;
  const [sight] = sightsOf([turned]);
  const depthOf = (x: number, y: number, z: number) => {
    const m = sight?.camFromWorld ?? [];
    return [m[8], m[9], m[10]].reduce((sum: number, f = 0, i) => sum + f * ([x, y, z][i] as number), 0);
  };
  expect(depthOf(-1, 0, 0)).toBeCloseTo(1, 9);
  expect(depthOf(0, 1, 0)).toBeCloseTo(0, 9);
  expect(sightsOf([{ view: 'no camera' } as View])).toEqual([]);
});

test('a first box is around the middle of the Gaussians', () => {
  const centers = Float32Array.from({ length: 3 * 1001 }, (_, i) => Math.floor(i / 3) * ((i % 3) + 1));
  const { min, max } = boxAround(centers);
  expect([...min, ...max]).toEqual([50, 100, 150, 950, 1900, 2850]);
});

test('a face moves by itself, but not past the opposite one', () => {
  const box = { min: [0, 0, 0], max: [1, 1, 1] } as const;
  expect(withFace(box, { axis: 1, side: 'max' }, 2)).toEqual({ min: [0, 0, 0], max: [1, 2, 1] });
  expect(withFace(box, { axis: 2, side: 'min' }, 5).min[2]).toBeCloseTo(0.99, 9);
  const centers = Float32Array.of(0.5, 0.5, 0.5, 0.5, 1.5, 0.5, NaN, 0, 0);
  expect([...withOutside(Uint8Array.of(1, 0, 0), box, centers)]).toEqual([1, 1, 1]);
  expect([...withOutside(Uint8Array.of(0, 0, 0), box, centers)]).toEqual([0, 1, 1]);
});

test('a handle follows the pointer along its axis', () => {
  const ray = new Ray(new Vector3(3, 1, 5), new Vector3(0, 0, -1));
  expect(nearestAlong(ray, new Vector3(1, 1, 1), new Vector3(1, 0, 0))).toBeCloseTo(2, 9);
  expect(nearestAlong(ray, new Vector3(1, 1, 1), new Vector3(0, 1, 0))).toBeCloseTo(0, 9);
  // Along the line of sight the pointer says nothing.
  expect(nearestAlong(ray, new Vector3(1, 1, 1), new Vector3(0, 0, 1))).toBe(0);
});
