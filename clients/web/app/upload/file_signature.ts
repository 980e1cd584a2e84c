// Photographs and videos by their first bytes, as the server recognises them: names may be wrong.

/** Number of bytes in which all signatures are. */
const numBytes = 12;

const heicBrands = ['heic', 'heix', 'heim', 'heis', 'hevc', 'mif1', 'msf1'];
const quickTimeAtoms = ['ftyp', 'moov', 'mdat', 'wide', 'free', 'skip'];

/** Returns the first bytes as Latin-1; empty if the file cannot be read. */
async function beginningOf(file: Blob): Promise<string> {
  try {
    const bytes = new Uint8Array(await file.slice(0, numBytes).arrayBuffer());
    return String.fromCharCode(...bytes);
  } catch {
    return ''; // the file has gone since it was dropped
  }
}

/** Returns whether the file begins as a JPEG, PNG, WebP or HEIC does. */
export async function beginsAsPhotograph(file: Blob): Promise<boolean> {
  const text = await beginningOf(file);
  const isJpeg = text.startsWith('\xff\xd8\xff');
  const isPng = text.startsWith('\x89PNG\r\n\x1a\n');
  const isWebp = text.startsWith('RIFF') && text.startsWith('WEBP', 8);
  const isHeic = text.startsWith('ftyp', 4) && heicBrands.includes(text.slice(8));
  return isJpeg || isPng || isWebp || isHeic;
}

/** Returns whether the file begins as an MP4, MOV, WebM, MKV or AVI does. */
export async function beginsAsVideo(file: Blob): Promise<boolean> {
  const text = await beginningOf(file);
  const isQuickTime = quickTimeAtoms.some((atom) => text.startsWith(atom, 4));
  const isMatroska = text.startsWith('\x1a\x45\xdf\xa3');
  const isAvi = text.startsWith('RIFF') && text.startsWith('AVI ', 8);
  return isQuickTime || isMatroska || isAvi;
}
