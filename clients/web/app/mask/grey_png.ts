// Reads pictures of 16-bit grey, whose values browsers would round to 8 bits: ids of segments.
import { unzlibSync } from 'fflate';

export interface GreyPicture {
  readonly width: number;
  readonly height: number;
  /** In row-major order. */
  readonly values: Uint16Array;
}

const signature = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];
const bytesPerPixel = 2;

function joined(parts: readonly Uint8Array[]): Uint8Array {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

/** Returns the predictor of PNG's filter 4: of left, above and their corner the nearest to their plane. */
function paeth(left: number, above: number, corner: number): number {
  const plane = left + above - corner;
  const [a, b, c] = [left, above, corner].map((value) => Math.abs(plane - value)) as [
    number,
    number,
    number,
  ];
  if (a <= b && a <= c) return left;
  return b <= c ? above : corner;
}

/** Undoes the filter of a scanline in place. `above`: the scanline before it. */
function unfilter(filter: number, line: Uint8Array, above: Uint8Array): void {
  for (let i = 0; i < line.length; ++i) {
    const left = i < bytesPerPixel ? 0 : (line[i - bytesPerPixel] as number);
    const up = above[i] as number;
    const corner = i < bytesPerPixel ? 0 : (above[i - bytesPerPixel] as number);
    const predicted = [0, left, up, (left + up) >> 1, paeth(left, up, corner)][filter];
    if (predicted === undefined) throw new Error(`a PNG has no filter ${filter}`);
    line[i] = (line[i] as number) + predicted;
  }
}

/** Throws if the bytes are not a PNG of 16-bit grey. */
export function readGreyPng(bytes: Uint8Array): GreyPicture {
  if (signature.some((byte, i) => bytes[i] !== byte)) throw new Error('not a PNG');
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const [width, height] = [view.getUint32(16), view.getUint32(20)];
  const format = [...bytes.subarray(24, 29)].join();
  if (format !== '16,0,0,0,0') throw new Error('not a PNG of 16-bit grey');
  const parts: Uint8Array[] = [];
  for (let at = signature.length; at < bytes.length;) {
    const length = view.getUint32(at);
    const name = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    if (name === 'IDAT') parts.push(bytes.subarray(at + 8, at + 8 + length));
    at += length + 12;
  }
  const lines = unzlibSync(joined(parts));
  const stride = width * bytesPerPixel;
  if (lines.length !== (stride + 1) * height) throw new Error('a PNG that is cut off');
  const values = new Uint16Array(width * height);
  let above = new Uint8Array(stride);
  for (let y = 0; y < height; ++y) {
    const begin = y * (stride + 1);
    const line = lines.subarray(begin + 1, begin + 1 + stride);
    unfilter(lines[begin] as number, line, above);
    for (let x = 0; x < width; ++x) {
      values[y * width + x] = ((line[2 * x] as number) << 8) | (line[2 * x + 1] as number);
    }
    above = line as Uint8Array<ArrayBuffer>;
  }
  return { width, height, values };
}
