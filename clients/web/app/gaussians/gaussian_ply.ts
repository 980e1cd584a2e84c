// PLY files of Gaussians as the server exports them: where the Gaussians are, and files of some of them.
import type { GaussianSet } from './gaussian_set';
import { inChunks } from './in_chunks';

export interface GaussianPly {
  readonly count: number;
  /** x, y, z of each Gaussian. */
  readonly centers: Float32Array;
  /** Largest standard deviation of each Gaussian. */
  readonly sizes: Float32Array;
  /** From 0 to 1. */
  readonly opacities: Float32Array;
  /** Luminance (Rec. 709) of the colour without its change by direction, from 0 to 1. */
  readonly luminances: Float32Array;
}

interface Property {
  readonly at: number;
  readonly isDouble: boolean;
}

interface Header {
  /** Lines before and after "element vertex COUNT". */
  readonly before: string;
  readonly after: string;
  readonly count: number;
  /** Bytes of the header. */
  readonly size: number;
  /** Bytes of a record. */
  readonly stride: number;
  readonly properties: ReadonlyMap<string, Property>;
}

const typeBytes: Readonly<Record<string, number>> = {
  char: 1,
  uchar: 1,
  short: 2,
  ushort: 2,
  int: 4,
  uint: 4,
  float: 4,
  double: 8,
};
/** Value of the constant spherical harmonic. */
const harmonic = 0.28209479177387814;
const headerEnd = 'end_header\n';
/** Maximum number of bytes of a header. */
const maxHeader = 1 << 16;
/** Records that are copied at a time, so that the page stays responsive. */
const recordsAtATime = 1 << 14;

/** Returns the luminance of red, green and blue, which are kept from 0 to 1. */
function luminanceOf(red: number, green: number, blue: number): number {
  const kept = (part: number) => Math.min(Math.max(part, 0), 1);
  return 0.2126 * kept(red) + 0.7152 * kept(green) + 0.0722 * kept(blue);
}

function headerOf(start: ArrayBuffer): Header {
  const text = new TextDecoder('latin1').decode(start);
  const end = text.indexOf(headerEnd);
  const element = /^element vertex (\d+)\n/m.exec(text);
  if (!text.startsWith('ply\nformat binary_little_endian') || end < 0 || !element) {
    throw new Error('the model’s file is not a PLY of Gaussians');
  }
  const size = end + headerEnd.length;
  const properties = new Map<string, Property>();
  let stride = 0;
  for (const [, type = '', name = ''] of text.slice(0, size).matchAll(/^property (\S+) (\S+)$/gm)) {
    properties.set(name, { at: stride, isDouble: type === 'double' });
    const bytes = typeBytes[type];
    if (!bytes) throw new Error(`the model’s PLY: property ${name} has the unknown type ${type}`);
    stride += bytes;
  }
  const before = text.slice(0, element.index);
  const after = text.slice(element.index + element[0].length, size);
  return { before, after, count: Number(element[1]), size, stride, properties };
}

/** Returns a function that reads a property of a Gaussian. */
function reader(bytes: ArrayBuffer, header: Header, name: string): (index: number) => number {
  const { size, stride, count, properties } = header;
  const property = properties.get(name);
  if (!property) throw new Error(`the model’s PLY has no property ${name}`);
  if (bytes.byteLength < size + count * stride) throw new Error('the model’s PLY is cut off');
  const view = new DataView(bytes, size);
  const { at, isDouble } = property;
  return isDouble
    ? (index) => view.getFloat64(index * stride + at, true)
    : (index) => view.getFloat32(index * stride + at, true);
}

/** Returns a function that writes x, y, z of the Gaussians from `first` to before `last`. */
function centerReader(bytes: ArrayBuffer, header: Header, to: Float32Array) {
  const axes = ['x', 'y', 'z'].map((name) => reader(bytes, header, name));
  return (first: number, last: number) => {
    for (const [axis, read] of axes.entries()) {
      for (let i = first; i < last; ++i) to[3 * i + axis] = read(i);
    }
  };
}

/** Returns x, y, z of each Gaussian of a PLY. Throws if it is not one. */
export async function centersOf(bytes: ArrayBuffer): Promise<Float32Array> {
  const header = headerOf(bytes.slice(0, maxHeader));
  const centers = new Float32Array(3 * header.count);
  await inChunks(header.count, centerReader(bytes, header, centers));
  return centers;
}

/** Takes long for many Gaussians: call it in a worker. Throws if the file is not a PLY of Gaussians. */
export function readGaussianPly(bytes: ArrayBuffer): GaussianPly {
  const header = headerOf(bytes.slice(0, maxHeader));
  const { count } = header;
  const sizes = new Float32Array(count);
  const opacities = new Float32Array(count);
  const luminances = new Float32Array(count);
  const [a, b, c] = ['scale_0', 'scale_1', 'scale_2'].map((name) => reader(bytes, header, name));
  const opacity = reader(bytes, header, 'opacity');
  const [red, green, blue] = ['f_dc_0', 'f_dc_1', 'f_dc_2'].map((name) => reader(bytes, header, name));
  for (let i = 0; a && b && c && i < count; ++i) {
    sizes[i] = Math.exp(Math.max(a(i), b(i), c(i)));
    opacities[i] = 1 / (1 + Math.exp(-opacity(i)));
  }
  for (let i = 0; red && green && blue && i < count; ++i) {
    const color = (value: number) => 0.5 + harmonic * value;
    luminances[i] = luminanceOf(color(red(i)), color(green(i)), color(blue(i)));
  }
  const centers = new Float32Array(3 * count);
  centerReader(bytes, header, centers)(0, count);
  return { count, centers, sizes, opacities, luminances };
}

/** Returns the PLY of the Gaussians that are in a set, whose records are those of `file`, byte for byte. */
export async function plyOf(file: Blob, set: GaussianSet): Promise<Blob> {
  const header = headerOf(await file.slice(0, maxHeader).arrayBuffer());
  const { size, stride, count } = header;
  const records: Uint8Array<ArrayBuffer>[] = [];
  let numKept = 0;
  for (let first = 0; first < count; first += recordsAtATime) {
    const last = Math.min(count, first + recordsAtATime);
    const piece = file.slice(size + first * stride, size + last * stride);
    const from = new Uint8Array(await piece.arrayBuffer());
    let kept = 0;
    for (let i = first; i < last; ++i) {
      if (!set[i]) continue;
      // Records only move to the front, so that none is overwritten before it is read.
      from.copyWithin(kept * stride, (i - first) * stride, (i - first + 1) * stride);
      kept += 1;
    }
    records.push(from.subarray(0, kept * stride));
    numKept += kept;
  }
  const text = `${header.before}element vertex ${numKept}\n${header.after}`;
  return new Blob([text, ...records], { type: 'application/octet-stream' });
}

/**
 * Returns the indices in `all` of the Gaussians of a part, which has them in the same order. Both are x, y, z
 * of each Gaussian. Throws if one is not in `all`.
 */
export function indicesIn(all: Float32Array, part: Float32Array): Uint32Array {
  const indices = new Uint32Array(part.length / 3);
  // Bits are compared, so that NaN equals itself.
  const [a, p] = [new Uint32Array(all.buffer), new Uint32Array(part.buffer)];
  let at = 0;
  for (let i = 0; i < indices.length; ++i, at += 3) {
    const [x, y, z] = [p[3 * i], p[3 * i + 1], p[3 * i + 2]];
    while (at < a.length && (a[at] !== x || a[at + 1] !== y || a[at + 2] !== z)) at += 3;
    if (at >= a.length) throw new Error('a part of the model has a Gaussian that the model has not');
    indices[i] = at / 3;
  }
  return indices;
}
