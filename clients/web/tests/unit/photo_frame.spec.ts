import { expect, test } from '@playwright/test';
import type { Edges, Zoom } from '../../app/scene/photo_frame';
import {
  edgesOf,
  fitted,
  maxScale,
  panned,
  revealed,
  spotAt,
  wheelFactor,
  zoomedAt,
} from '../../app/scene/photo_frame';

const stage: Edges = { left: 100, top: 50, width: 800, height: 600 };
/** Half as high as wide: above and below it the stage is empty. */
const photo = { width: 4000, height: 2000 };

function spot(zoom: Zoom, x: number, y: number) {
  return spotAt(edgesOf(stage, photo, zoom), photo, { x, y });
}

test('at the smallest scale all of the photograph is in the middle of the stage', () => {
  expect(edgesOf(stage, photo, fitted)).toEqual({ left: 100, top: 150, width: 800, height: 400 });
  const high = { width: 1000, height: 2000 };
  expect(edgesOf(stage, high, fitted)).toEqual({ left: 350, top: 50, width: 300, height: 600 });
});

test('a position of the screen is a pixel of the photograph', () => {
  expect(spot(fitted, 100, 150)).toEqual({ x: 0, y: 0 });
  expect(spot(fitted, 500, 350)).toEqual({ x: 2000, y: 1000 });
  expect(spot(fitted, 101, 151)).toEqual({ x: 5, y: 5 });
  // At four times the scale a pixel of the screen is a quarter as many pixels of the photograph.
  const zoom = { scale: 4, x: 0.25, y: 0.5 };
  expect(spot(zoom, 500, 350)).toEqual({ x: 1000, y: 1000 });
  expect(spot(zoom, 504, 346).x).toBeCloseTo(1005, 6);
  expect(spot(zoom, 504, 346).y).toBeCloseTo(995, 6);
});

test('a position outside is a pixel at the border', () => {
  const { x, y } = spot(fitted, 2000, 0);
  expect([Math.floor(x), y]).toEqual([3999, 0]);
});

test('the pixel under the pointer stays there while the scale changes', () => {
  const at = { x: 333, y: 277 };
  const before = spot(fitted, at.x, at.y);
  let zoom = fitted;
  for (let i = 0; i < 12; ++i) {
    zoom = zoomedAt(stage, photo, zoom, 1.25, at);
    // Up and down only where the photograph is higher than the stage: else it stays in the middle.
    expect(spot(zoom, at.x, at.y).x).toBeCloseTo(before.x, 6);
  }
  expect(zoom.scale).toBeCloseTo(1.25 ** 12, 6);
  const there = spot(zoom, at.x, at.y);
  const further = zoomedAt(stage, photo, zoom, 0.9, at);
  expect(spot(further, at.x, at.y).x).toBeCloseTo(there.x, 6);
  expect(spot(further, at.x, at.y).y).toBeCloseTo(there.y, 6);
});

test('the scale ends at 1 and at the largest', () => {
  const at = { x: 120, y: 160 };
  const near = zoomedAt(stage, photo, fitted, 1000, at);
  expect(near.scale).toBe(maxScale);
  expect(zoomedAt(stage, photo, near, 1 / 1000, at)).toEqual(fitted);
});

test('a pan ends at the borders of the photograph', () => {
  const zoom = { scale: 4, x: 0.5, y: 0.5 };
  expect(panned(stage, photo, zoom, { x: 320, y: -160 })).toEqual({ scale: 4, x: 0.4, y: 0.6 });
  const corner = panned(stage, photo, zoom, { x: 1e6, y: 1e6 });
  const { left, top } = edgesOf(stage, photo, corner);
  expect([left, top]).toEqual([stage.left, stage.top]);
  // A photograph that fits cannot be moved.
  expect(panned(stage, photo, fitted, { x: 50, y: 50 })).toEqual(fitted);
});

test('a spot outside the stage is shown by the smallest move', () => {
  const zoom = { scale: 4, x: 0.5, y: 0.5 };
  expect(revealed(stage, photo, zoom, { x: 2100, y: 1000 })).toEqual(zoom);
  const moved = revealed(stage, photo, zoom, { x: 3000, y: 1000 });
  const edges = edgesOf(stage, photo, moved);
  const x = edges.left + (3000 / photo.width) * edges.width;
  expect(x).toBeCloseTo(stage.left + 0.9 * stage.width, 6);
  expect(moved.y).toBe(0.5);
});

test('a wheel zooms in steps, and one large turn by no more than 1.8 times', () => {
  const turn = (deltaY: number, deltaMode = 0, ctrlKey = false) =>
    wheelFactor({ deltaY, deltaMode, ctrlKey } as WheelEvent);
  expect(turn(-100)).toBeCloseTo(1.22, 2);
  expect(turn(100) * turn(-100)).toBeCloseTo(1, 9);
  expect(turn(-3, 1)).toBeCloseTo(turn(-99), 9); // lines
  expect(turn(-5, 0, true)).toBeCloseTo(1.05, 2); // a pinch on a touchpad
  expect(turn(-100_000)).toBeLessThan(1.83);
});
