// The size of a photograph from its header: no pixel is decoded.

export interface PixelSize {
  readonly width: number;
  readonly height: number;
}

/** Bytes in which the header is, with the thumbnail and colour profile that cameras put before it. */
const headerBytes = 256 << 10;

/** Returns whether a JPEG marker begins a frame, which has the size. */
function isFrame(marker: number): boolean {
  return marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker);
}

function jpegSize(bytes: DataView): PixelSize | undefined {
  for (let at = 2; at + 9 <= bytes.byteLength; ) {
    if (bytes.getUint8(at) !== 0xff) return undefined;
    const marker = bytes.getUint8(at + 1);
    if (isFrame(marker)) return { height: bytes.getUint16(at + 5), width: bytes.getUint16(at + 7) };
    // A marker may be filled with 0xff.
    at += marker === 0xff ? 1 : 2 + bytes.getUint16(at + 2);
  }
  return undefined;
}

/** Returns the size of a JPEG or PNG; undefined for others, and where it is not in the header. */
export async function pixelSizeOf(file: Blob): Promise<PixelSize | undefined> {
  const bytes = new DataView(await file.slice(0, headerBytes).arrayBuffer());
  if (bytes.byteLength >= 4 && bytes.getUint16(0) === 0xffd8) return jpegSize(bytes);
  if (bytes.byteLength >= 24 && bytes.getUint32(0) === 0x89504e47) {
    return { width: bytes.getUint32(16), height: bytes.getUint32(20) };
  }
  return undefined;
}
