// Draws what a click would give: almost clear inside, dashed in black and white at its border, which shows
// on every photograph and is unlike the masks of paint.ts.
import { shrunkMask } from './paint';
import type { Rle } from './rle';

const white = 0xffffffff;
const black = 0xff000000;
/** White with an alpha of 20 %. */
const inside = 0x33ffffff;
/** Length of a dash, pixels of the canvas. */
const dash = 4;

/** Draws the preview on a canvas of the mask's size, but at most `maxSide`. Without a mask it is empty. */
export function paintPreview(
  canvas: HTMLCanvasElement,
  mask: Rle | undefined,
  maxSide: number,
): void {
  const context = canvas.getContext('2d');
  if (!mask || mask.width === 0 || !context) {
    canvas.width = 1;
    canvas.height = 1;
    return;
  }
  const { width, height, pixels } = shrunkMask(mask, maxSide);
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  const image = context.createImageData(width, height);
  const words = new Uint32Array(image.data.buffer);
  for (let y = 0, i = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x, ++i) {
      if (!pixels[i]) continue;
      const isBorder =
        x === 0 ||
        y === 0 ||
        x === width - 1 ||
        y === height - 1 ||
        !pixels[i - 1] ||
        !pixels[i + 1] ||
        !pixels[i - width] ||
        !pixels[i + width];
      const isWhite = Math.floor((x + y) / dash) % 2 === 0;
      words[i] = !isBorder ? inside : isWhite ? white : black;
    }
  }
  context.putImageData(image, 0, 0);
}
