// The 3D camera's place as text, and the photographs' cameras under the pointer.
import { expect, test } from '@playwright/test';
import { PerspectiveCamera } from 'three';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { CameraPlace } from '../../app/viewer/camera_text';
import { placeText, readPlace } from '../../app/viewer/camera_text';
import { Frustums, isInside } from '../../app/viewer/frustums';

const lens = { across: 0.66667, up: 0.5 };

test('a place comes back from its text, also far from the origin', () => {
  const near: CameraPlace = { position: [0.12345678, -2, 3], target: [0, 0.5, 0], lens };
  const read = readPlace(placeText(near));
  expect(read?.position[0]).toBeCloseTo(0.1235, 4);
  expect(read).toMatchObject({ target: [0, 0.5, 0], lens });
  const far: CameraPlace = {
    position: [4_500_000.1234, 5_400_000, 0],
    target: [4_500_000, 5_400_000, 0],
    lens,
  };
  expect(readPlace(placeText(far))?.position[0]).toBeCloseTo(4_500_000.1234, 4);
  expect(placeText(near).length).toBeLessThan(60);
});

test('text that is no place is not taken', () => {
  for (const text of [
    undefined,
    '',
    '1,2,3',
    '0,0,0,1,1,1,0.5,zero',
    '0,0,0,1,1,1,,0.5',
    '0,0,0,1,1,1,0.5,Infinity',
    '0,0,0,1,1,1,-0.5,0.5',
    '1,1,1,1,1,1,0.5,0.5',
  ]) {
    expect(readPlace(text), text).toBeUndefined();
  }
});

test('a spot is inside a convex outline, whichever way it goes around', () => {
  const square = [
    { x: 0, y: 0 },
    { x: 10, y: 0 },
    { x: 10, y: 10 },
    { x: 0, y: 10 },
  ];
  for (const outline of [square, [...square].reverse()]) {
    expect(isInside(outline, { x: 5, y: 5 })).toBe(true);
    expect(isInside(outline, { x: 11, y: 5 })).toBe(false);
    expect(isInside(outline, { x: -1, y: -1 })).toBe(false);
  }
});

/** A view at a position of the world that looks along z, 90 degrees wide and high. */
function viewAt(view: string, x: number, z: number): View {
  const camera = { width: 100, height: 100, fx: 50, fy: 50, cx: 50, cy: 50 };
  const rotation = { w: 1, x: 0, y: 0, z: 0 };
  return { view, camera, camFromWorld: { rotation, translation: { x: -x, y: 0, z: -z } } } as unknown as View;
}

test('the camera under the pointer is found, the nearest first, but not the own one', () => {
  // The picture is seen from z = -10, along z.
  const camera = new PerspectiveCamera(90, 1, 0.01, 1000);
  camera.position.set(0, 0, -10);
  camera.up.set(0, -1, 0);
  camera.lookAt(0, 0, 0);
  camera.updateMatrixWorld();
  const frustums = new Frustums([
    viewAt('near', 0, 0),
    viewAt('behind it', 0, 20),
    viewAt('right', 5, 0),
    viewAt('own', 0, -10),
    viewAt('at the back', 0, -30),
  ]);
  const at = (x: number, y: number) => frustums.viewAt({ x, y }, camera, 1000, 1000);
  frustums.visible = true;
  expect(at(0.5, 0.5), 'without a size there is nothing').toBeUndefined();
  frustums.fit(1);
  expect(at(0.5, 0.5)).toBe('near');
  // 5 of 10 to the right: three quarters of the width.
  expect(at(0.75, 0.5)).toBe('right');
  expect(at(0.6, 0.5)).toBeUndefined();
  frustums.visible = false;
  expect(at(0.5, 0.5)).toBeUndefined();
});
