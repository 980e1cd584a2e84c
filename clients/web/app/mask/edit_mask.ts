// Changes masks by hand: outlines and strokes that are drawn, in pixels of the mask.
import { encodeRle } from './encode_rle';
import type { Rle } from './rle';
import { decodeRle } from './rle';

interface Vertex {
  readonly x: number;
  readonly y: number;
}

/** A line of this width with round ends. */
export interface Line {
  readonly path: readonly Vertex[];
  readonly width: number;
}

interface Crossing {
  readonly x: number;
  /** 1 downwards, -1 upwards. */
  readonly way: number;
}

/** Returns where an outline, which is closed, crosses a horizontal line, from left to right. */
function crossingsAt(path: readonly Vertex[], y: number): Crossing[] {
  const found = path.flatMap((from, i): Crossing[] => {
    const to = path[(i + 1) % path.length] as Vertex;
    if (from.y <= y === to.y <= y) return [];
    const x = from.x + ((y - from.y) / (to.y - from.y)) * (to.x - from.x);
    return [{ x, way: to.y > from.y ? 1 : -1 }];
  });
  return found.sort((a, b) => a.x - b.x);
}

/**
 * Returns the mask of the pixels whose middle is inside an outline, which is closed by a line from its end to
 * its beginning. What it goes around twice is inside, too.
 */
export function outlined(path: readonly Vertex[], width: number, height: number): Rle {
  const pixels = new Uint8Array(width * height);
  for (let y = 0; y < height; ++y) {
    let turns = 0;
    let begin = 0;
    for (const { x, way } of crossingsAt(path, y + 0.5)) {
      if (turns === 0) begin = x;
      turns += way;
      if (turns !== 0) continue;
      const first = Math.max(0, Math.ceil(begin - 0.5));
      const end = Math.min(width, Math.ceil(x - 0.5));
      if (first < end) pixels.fill(1, y * width + first, y * width + end);
    }
  }
  return encodeRle(width, height, (x, y) => pixels[y * width + x] === 1);
}

/** Returns the squared distance of a position from the line between two others. */
function squaredDistance(x: number, y: number, a: Vertex, b: Vertex): number {
  const [dx, dy] = [b.x - a.x, b.y - a.y];
  const length = dx * dx + dy * dy;
  const along = length === 0 ? 0 : ((x - a.x) * dx + (y - a.y) * dy) / length;
  const share = Math.min(Math.max(along, 0), 1);
  return (x - a.x - share * dx) ** 2 + (y - a.y - share * dy) ** 2;
}

/** Returns the mask with the pixels under a line added, or (`isErased`) taken away. */
export function withLine(mask: Rle, { path, width: across }: Line, isErased: boolean): Rle {
  const { width, height } = mask;
  const pixels = decodeRle(mask);
  // At least the pixel under each vertex.
  const radius = Math.max(across / 2, Math.SQRT1_2);
  path.forEach((from, i) => {
    const to = path[i + 1] ?? from;
    const left = Math.max(0, Math.floor(Math.min(from.x, to.x) - radius));
    const right = Math.min(width - 1, Math.ceil(Math.max(from.x, to.x) + radius));
    const top = Math.max(0, Math.floor(Math.min(from.y, to.y) - radius));
    const bottom = Math.min(height - 1, Math.ceil(Math.max(from.y, to.y) + radius));
    for (let y = top; y <= bottom; ++y) {
      for (let x = left; x <= right; ++x) {
        if (squaredDistance(x + 0.5, y + 0.5, from, to) > radius * radius) continue;
        pixels[y * width + x] = isErased ? 0 : 1;
      }
    }
  });
  return encodeRle(width, height, (x, y) => pixels[y * width + x] === 1);
}

/** Returns an empty mask. */
export function emptyMask(width: number, height: number): Rle {
  return encodeRle(width, height, () => false);
}
