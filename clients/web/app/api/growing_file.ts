// A file that comes in chunks.

/** Bytes that become a Blob at a time: browsers keep large Blobs on the disk, arrays in memory. */
const pieceBytes = 16 << 20;

export class GrowingFile {
  /** Bytes that came. */
  size = 0;
  private readonly pieces: Blob[] = [];
  private chunks: Uint8Array<ArrayBuffer>[] = [];
  private pending = 0;

  add(chunk: Uint8Array<ArrayBuffer>): void {
    this.chunks.push(chunk);
    this.size += chunk.length;
    this.pending += chunk.length;
    if (this.pending < pieceBytes) return;
    this.pieces.push(new Blob(this.chunks));
    this.chunks = [];
    this.pending = 0;
  }

  whole(type: string): Blob {
    return new Blob([...this.pieces, ...this.chunks], { type });
  }
}
