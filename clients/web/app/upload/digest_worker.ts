// SHA-256 of files, a piece at a time: a video need not fit in memory, and WebCrypto takes only
// whole files, and those only from pages over HTTPS.
import { sha256 } from '@noble/hashes/sha2';
import { bytesToHex } from '@noble/hashes/utils';

export interface DigestQuestion {
  readonly id: number;
  readonly file: Blob;
}

export interface DigestAnswer {
  readonly id: number;
  readonly sha256: string;
  /** Not empty: the file cannot be read, and why. */
  readonly error: string;
}

const pieceBytes = 4 << 20;

async function digest(file: Blob): Promise<string> {
  const hash = sha256.create();
  for (let at = 0; at < file.size; at += pieceBytes) {
    hash.update(new Uint8Array(await file.slice(at, at + pieceBytes).arrayBuffer()));
  }
  return bytesToHex(hash.digest());
}

self.onmessage = async ({ data }: MessageEvent<DigestQuestion>) => {
  const answer = { id: data.id, sha256: '', error: '' };
  try {
    answer.sha256 = await digest(data.file);
  } catch (error) {
    answer.error = String(error);
  }
  self.postMessage(answer satisfies DigestAnswer);
};
