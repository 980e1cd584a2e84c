import { expect, test } from '@playwright/test';
import { Vector3 } from 'three';
import { keepWithin, reachOf, sphereOf } from '../../app/viewer/reach';

const sphere = { center: new Vector3(1, 0, 0), radius: 2 };

test('a sphere holds most of the points, and no floaters', () => {
  const points = Array.from({ length: 99 }, (_, i) => new Vector3(i / 98, 0, 0));
  points.push(new Vector3(1000, 0, 0));
  const { center, radius } = sphereOf(points) ?? sphere;
  expect(center.x).toBeCloseTo(0.5, 1);
  expect(radius).toBeGreaterThan(0.4);
  expect(radius).toBeLessThan(0.6);
  expect(sphereOf([])).toBeUndefined();
});

test('the camera goes no further than four radii from the centre, still towards its target', () => {
  const target = new Vector3(2, 0, 0);
  const reach = reachOf(sphere, new Vector3(1, 0, 4), target);
  expect([reach.camera, reach.target]).toEqual([8, 2]);
  const camera = new Vector3(2, 0, 40);
  expect(keepWithin(reach, camera, target)).toBe(true);
  expect(camera.distanceTo(sphere.center)).toBeCloseTo(8, 9);
  expect([camera.x, camera.y]).toEqual([2, 0]);
  expect(target.toArray()).toEqual([2, 0, 0]);
});

test('a pan that leaves the scene is stopped, and does not turn the camera', () => {
  const target = new Vector3(9, 0, 0);
  const camera = new Vector3(9, 0, 3);
  expect(keepWithin(reachOf(sphere, camera, sphere.center), camera, target)).toBe(true);
  expect(target.toArray()).toEqual([3, 0, 0]);
  expect(camera.toArray()).toEqual([3, 0, 3]);
});

test('what is within reach stays, and so does a camera that was put further away', () => {
  const target = new Vector3(1, 1, 0);
  const camera = new Vector3(1, 1, 20);
  expect(keepWithin(reachOf(sphere, camera, target), camera, target)).toBe(false);
  expect(camera.toArray()).toEqual([1, 1, 20]);
});
