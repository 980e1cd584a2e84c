// Where a photograph is on the screen, and which of its pixels is at a position of the screen. All clicks,
// boxes, strokes and gestures go through these functions. Positions are pixels of the screen, if not said
// otherwise.
import type { Spot } from './marks';

export interface Size {
  readonly width: number;
  readonly height: number;
}

export interface Edges extends Size {
  readonly left: number;
  readonly top: number;
}

export interface Zoom {
  /** From 1, at which all of the photograph fits the stage, to `maxScale`. */
  readonly scale: number;
  /** The part of the photograph that is in the middle of the stage, as shares of width and height. */
  readonly x: number;
  readonly y: number;
}

export const maxScale = 16;
export const fitted: Zoom = { scale: 1, x: 0.5, y: 0.5 };

function clamp(value: number, least: number, most: number): number {
  return Math.min(Math.max(value, least), most);
}

/** Returns the photograph's size on the screen. */
function shownSize(stage: Size, photo: Size, scale: number): Size {
  const fit = Math.min(stage.width / photo.width, stage.height / photo.height);
  return { width: photo.width * fit * scale, height: photo.height * fit * scale };
}

/** Returns the edges of the photograph, of which the stage may show a part. */
export function edgesOf(stage: Edges, photo: Size, { scale, x, y }: Zoom): Edges {
  const { width, height } = shownSize(stage, photo, scale);
  return {
    left: stage.left + stage.width / 2 - x * width,
    top: stage.top + stage.height / 2 - y * height,
    width,
    height,
  };
}

/** Returns the position in the photograph, pixels of the photograph; at its border if it is outside. */
export function spotAt(edges: Edges, photo: Size, at: Spot): Spot {
  return {
    x: clamp(((at.x - edges.left) / edges.width) * photo.width, 0, photo.width - 0.01),
    y: clamp(((at.y - edges.top) / edges.height) * photo.height, 0, photo.height - 0.01),
  };
}

/** Returns a zoom within its limits: the stage is empty only where the photograph is smaller than it. */
function limited(stage: Size, photo: Size, { scale, x, y }: Zoom): Zoom {
  const within = clamp(scale, 1, maxScale);
  const { width, height } = shownSize(stage, photo, within);
  const middle = (share: number, shown: number, whole: number) => {
    const half = shown / whole / 2;
    return half >= 0.5 ? 0.5 : clamp(share, half, 1 - half);
  };
  return {
    scale: within,
    x: middle(x, stage.width, width),
    y: middle(y, stage.height, height),
  };
}

/** Multiplies the scale; what is at `at` stays there, as far as the limits let it. */
export function zoomedAt(stage: Edges, photo: Size, zoom: Zoom, factor: number, at: Spot): Zoom {
  const scale = clamp(zoom.scale * factor, 1, maxScale);
  const before = edgesOf(stage, photo, zoom);
  const { width, height } = shownSize(stage, photo, scale);
  const fromMiddle = {
    x: at.x - stage.left - stage.width / 2,
    y: at.y - stage.top - stage.height / 2,
  };
  return limited(stage, photo, {
    scale,
    x: (at.x - before.left) / before.width - fromMiddle.x / width,
    y: (at.y - before.top) / before.height - fromMiddle.y / height,
  });
}

/** Moves the photograph by a distance on the screen. */
export function panned(stage: Size, photo: Size, zoom: Zoom, by: Spot): Zoom {
  const { width, height } = shownSize(stage, photo, zoom.scale);
  return limited(stage, photo, { ...zoom, x: zoom.x - by.x / width, y: zoom.y - by.y / height });
}

/** Moves the photograph as little as shows a spot of it, with a margin of a tenth of the stage. */
export function revealed(stage: Size, photo: Size, zoom: Zoom, spot: Spot): Zoom {
  const { width, height } = shownSize(stage, photo, zoom.scale);
  const middle = (share: number, now: number, reach: number) =>
    clamp(now, share - reach, share + reach);
  return limited(stage, photo, {
    scale: zoom.scale,
    x: middle(spot.x / photo.width, zoom.x, (0.4 * stage.width) / width),
    y: middle(spot.y / photo.height, zoom.y, (0.4 * stage.height) / height),
  });
}

/** Returns the factor of the scale for a turn of the wheel, or a pinch on a touchpad. */
export function wheelFactor({ deltaY, deltaMode, ctrlKey }: WheelEvent): number {
  const pixels = deltaMode === 0 ? deltaY : deltaY * 33;
  return Math.exp(-clamp(pixels, -300, 300) * (ctrlKey ? 0.01 : 0.002));
}
