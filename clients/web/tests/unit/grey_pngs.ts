// PNGs of 16-bit grey for tests.
import { deflateSync } from 'node:zlib';

function chunk(name: string, data: Buffer): Buffer {
  const length = Buffer.alloc(4);
  length.writeUInt32BE(data.length);
  // The checksum is not read.
  return Buffer.concat([length, Buffer.from(name, 'latin1'), data, Buffer.alloc(4)]);
}

/** Predicts a byte by a filter of PNG from its neighbours. */
function predicted(filter: number, left: number, up: number, corner: number): number {
  if (filter < 4) return [0, left, up, Math.floor((left + up) / 2)][filter] as number;
  const plane = left + up - corner;
  const far = (value: number) => Math.abs(plane - value);
  if (far(left) <= far(up) && far(left) <= far(corner)) return left;
  return far(up) <= far(corner) ? up : corner;
}

/** Returns a PNG of 16-bit grey, in `numParts` chunks, with each of its lines filtered in another way. */
export function pngOf(width: number, values: readonly number[], numParts = 1, depth = 16): Buffer {
  const height = values.length / width;
  const raw = Buffer.alloc(values.length * 2);
  values.forEach((value, i) => raw.writeUInt16BE(value, 2 * i));
  const stride = 2 * width;
  const at = (y: number, i: number) => (y < 0 || i < 0 ? 0 : (raw[y * stride + i] as number));
  const lines = Buffer.alloc((stride + 1) * height);
  for (let y = 0; y < height; ++y) {
    const filter = y % 5;
    lines[y * (stride + 1)] = filter;
    for (let i = 0; i < stride; ++i) {
      const guess = predicted(filter, at(y, i - 2), at(y - 1, i), at(y - 1, i - 2));
      lines[y * (stride + 1) + 1 + i] = at(y, i) - guess;
    }
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header[8] = depth;
  const data = deflateSync(lines);
  const step = Math.ceil(data.length / numParts);
  const parts = Array.from({ length: numParts }, (_, i) =>
    chunk('IDAT', data.subarray(i * step, (i + 1) * step)),
  );
  const begin = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  return Buffer.concat([begin, chunk('IHDR', header), ...parts, chunk('IEND', Buffer.alloc(0))]);
}
