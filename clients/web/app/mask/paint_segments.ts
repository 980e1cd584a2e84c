// Draws the segments of a view, each in its colour.
import type { GreyPicture } from './grey_png';

type Color = readonly [red: number, green: number, blue: number];

export interface SegmentStyle {
  readonly colorOf: (id: number) => Color;
  /** Id of the segment that is emphasised; 0: none. */
  readonly emphasised: number;
  /** Segments without a fill. */
  readonly isHidden: (id: number) => boolean;
  /** Draws the borders alone. */
  readonly isFaint: boolean;
}

const fillAlpha = 85;
const emphasisedAlpha = 165;
const borderColor = 0xb4ffffff; // white, alpha 180
const emphasisedBorder = 0xff000000;

function packed([red, green, blue]: Color, alpha: number): number {
  return ((alpha << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

/** Returns the picture with its longer side shrunk to `maxSide` by taking the nearest pixels. */
export function shrunkGrey(picture: GreyPicture, maxSide: number): GreyPicture {
  const scale = maxSide / Math.max(picture.width, picture.height);
  if (scale >= 1) return picture;
  const width = Math.max(1, Math.round(picture.width * scale));
  const height = Math.max(1, Math.round(picture.height * scale));
  const values = new Uint16Array(width * height);
  for (let y = 0, i = 0; y < height; ++y) {
    const row = Math.floor(((y + 0.5) * picture.height) / height) * picture.width;
    for (let x = 0; x < width; ++x, ++i) {
      values[i] = picture.values[row + Math.floor(((x + 0.5) * picture.width) / width)] as number;
    }
  }
  return { width, height, values };
}

/** Returns the drawing as words of red, green, blue and alpha, the lowest byte first. */
export function segmentWords(
  { width, height, values }: GreyPicture,
  { colorOf, emphasised, isHidden, isFaint }: SegmentStyle,
): Uint32Array<ArrayBuffer> {
  const words = new Uint32Array(width * height);
  const fills = new Map<number, number>();
  const fillOf = (id: number) => {
    const known = fills.get(id);
    if (known !== undefined) return known;
    const isPlain = id !== emphasised && (isFaint || isHidden(id));
    const alpha = id === emphasised ? emphasisedAlpha : fillAlpha;
    const fill = isPlain ? 0 : packed(colorOf(id), alpha);
    fills.set(id, fill);
    return fill;
  };
  for (let y = 0, i = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x, ++i) {
      const id = values[i] as number;
      // Each border is drawn once, on the side of the right and the lower segment.
      const left = x > 0 ? (values[i - 1] as number) : id;
      const above = y > 0 ? (values[i - width] as number) : id;
      const isBorder = left !== id || above !== id;
      const isEmphasised = emphasised > 0 && [id, left, above].includes(emphasised);
      if (isBorder) words[i] = isEmphasised ? emphasisedBorder : borderColor;
      else if (id > 0) words[i] = fillOf(id);
    }
  }
  return words;
}

/** Draws the segments on a canvas of the picture's size; without a picture it is empty. */
export function paintSegments(
  canvas: HTMLCanvasElement,
  picture: GreyPicture | undefined,
  style: SegmentStyle,
): void {
  const { width, height } = picture ?? { width: 1, height: 1 };
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  const context = canvas.getContext('2d');
  if (!context) return;
  const image = context.createImageData(width, height);
  if (picture) new Uint32Array(image.data.buffer).set(segmentWords(picture, style));
  context.putImageData(image, 0, 0);
}
