// The pieces of a mask: pixels that are connected by their sides.
import { encodeRle } from './encode_rle';
import type { Rle } from './rle';
import { decodeRle } from './rle';

/** A piece is small if it has less than this share of the largest one's pixels. */
const smallShare = 0.05;

interface Pieces {
  /** Number of the piece of each pixel, from 1; 0: outside the mask. */
  readonly pieceOf: Int32Array;
  /** Pixels of each piece, by its number - 1. */
  readonly areas: readonly number[];
}

function piecesOf(mask: Rle): Pieces {
  const { width, height } = mask;
  const pixels = decodeRle(mask);
  const pieceOf = new Int32Array(pixels.length);
  const areas: number[] = [];
  const waiting: number[] = [];
  for (let start = 0; start < pixels.length; ++start) {
    if (!pixels[start] || pieceOf[start]) continue;
    const piece = areas.length + 1;
    let area = 0;
    pieceOf[start] = piece;
    waiting.push(start);
    for (let at = waiting.pop(); at !== undefined; at = waiting.pop()) {
      ++area;
      const x = at % width;
      const visit = (next: number) => {
        if (!pixels[next] || pieceOf[next]) return;
        pieceOf[next] = piece;
        waiting.push(next);
      };
      if (x > 0) visit(at - 1);
      if (x < width - 1) visit(at + 1);
      if (at >= width) visit(at - width);
      if (at < width * (height - 1)) visit(at + width);
    }
    areas.push(area);
  }
  return { pieceOf, areas };
}

/** Returns the mask of the pieces that have at least `least` pixels; undefined: all of them have. */
function withPieces(mask: Rle, { pieceOf, areas }: Pieces, least: number): Rle | undefined {
  const isKept = areas.map((area) => area >= least);
  if (isKept.every(Boolean)) return undefined;
  const { width, height } = mask;
  return encodeRle(width, height, (x, y) => {
    const piece = pieceOf[y * width + x] as number;
    return piece > 0 && isKept[piece - 1] === true;
  });
}

/** Returns the mask of its largest piece; undefined if it is in one piece. */
export function largestPiece(mask: Rle): Rle | undefined {
  const pieces = piecesOf(mask);
  return withPieces(mask, pieces, Math.max(...pieces.areas));
}

/** Returns the mask without its small pieces; undefined if it has none. */
export function withoutSmallPieces(mask: Rle): Rle | undefined {
  const pieces = piecesOf(mask);
  return withPieces(mask, pieces, smallShare * Math.max(...pieces.areas));
}
