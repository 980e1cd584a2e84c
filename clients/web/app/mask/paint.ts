// Draws a mask over its picture: tinted inside, outlined at its border.
import type { Rle } from './rle';
import { decodeRle } from './rle';

type Color = readonly [red: number, green: number, blue: number, alpha: number];

/** A mask in a colour. */
export interface Layer {
  readonly rle: Rle;
  readonly color: readonly [red: number, green: number, blue: number];
}

const tint = [20, 184, 166] as const;
const tintAlpha = 105;
const outline: Color = [255, 255, 255, 235];

/** Tints the mask, and outlines pixels with a neighbour outside it; the picture's edge is no border. */
function fill(
  words: Uint32Array,
  { width, height, pixels }: Pixels,
  inside: number,
  border: number,
): void {
  for (let y = 0, i = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x, ++i) {
      if (!pixels[i]) continue;
      const isBorder =
        (x > 0 && !pixels[i - 1]) ||
        (x < width - 1 && !pixels[i + 1]) ||
        (y > 0 && !pixels[i - width]) ||
        (y < height - 1 && !pixels[i + width]);
      words[i] = isBorder ? border : inside;
    }
  }
}

function packed([red, green, blue, alpha]: Color): number {
  return ((alpha << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

export interface Pixels {
  readonly width: number;
  readonly height: number;
  readonly pixels: Uint8Array;
}

/** Shrinks the mask's longer side to `maxSide` by taking the nearest pixels. */
export function shrunkMask(mask: Rle, maxSide: number): Pixels {
  const pixels = decodeRle(mask);
  const scale = maxSide / Math.max(mask.width, mask.height);
  if (scale >= 1) return { width: mask.width, height: mask.height, pixels };
  const width = Math.max(1, Math.round(mask.width * scale));
  const height = Math.max(1, Math.round(mask.height * scale));
  const small = new Uint8Array(width * height);
  for (let y = 0, i = 0; y < height; ++y) {
    const row = Math.floor(((y + 0.5) * mask.height) / height) * mask.width;
    for (let x = 0; x < width; ++x, ++i) {
      small[i] = pixels[row + Math.floor(((x + 0.5) * mask.width) / width)] ?? 0;
    }
  }
  return { width, height, pixels: small };
}

/**
 * Draws the mask on a canvas of the mask's size, but at most `maxSide`: masks are as large as
 * photographs, which are larger than screens. An empty mask clears the canvas. `color`: the accent's, if
 * it is absent.
 */
export function paintMask(
  canvas: HTMLCanvasElement,
  mask: Rle | undefined,
  color: Layer['color'] = tint,
  maxSide = 2048,
): void {
  paintLayers(canvas, mask ? [{ rle: mask, color }] : [], maxSide);
}

/** Draws masks of one size over each other, the last one on top; none clears the canvas. */
export function paintLayers(
  canvas: HTMLCanvasElement,
  layers: readonly Layer[],
  maxSide = 2048,
): void {
  const drawn = layers.filter(({ rle }) => rle.width > 0);
  const [first] = drawn;
  if (!first) {
    canvas.width = 1;
    canvas.height = 1;
    return;
  }
  const { width, height } = shrunkMask(first.rle, maxSide);
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  const context = canvas.getContext('2d');
  if (!context) return;
  const image = context.createImageData(width, height);
  const words = new Uint32Array(image.data.buffer);
  for (const { rle, color } of drawn) {
    const mask = shrunkMask(rle, maxSide);
    if (mask.width !== width || mask.height !== height) continue;
    fill(words, mask, packed([...color, tintAlpha]), packed(outline));
  }
  context.putImageData(image, 0, 0);
}

/** Returns a black and white picture, which most tools read as a mask. */
export async function maskPng(mask: Rle): Promise<Blob> {
  const canvas = new OffscreenCanvas(mask.width, mask.height);
  const context = canvas.getContext('2d');
  if (!context) throw new Error('the browser draws no pictures');
  const image = context.createImageData(mask.width, mask.height);
  const words = new Uint32Array(image.data.buffer);
  decodeRle(mask).forEach((inside, i) => (words[i] = inside ? 0xffffffff : 0xff000000));
  context.putImageData(image, 0, 0);
  return canvas.convertToBlob({ type: 'image/png' });
}
