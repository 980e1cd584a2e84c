// SHA-256 of files, piece by piece: a video need not fit in memory. WebCrypto takes whole files
// only, and only on pages over HTTPS.
import { sha256 } from '@noble/hashes/sha2';
import { bytesToHex } from '@noble/hashes/utils';

export interface DigestRequest {
  readonly id: number;
  readonly file: Blob;
}

export interface DigestAnswer {
  readonly id: number;
  readonly sha256: string;
  /** Why the file cannot be read; empty if it can. */
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

self.onmessage = async ({ data }: MessageEvent<DigestRequest>) => {
  const answer = { id: data.id, sha256: '', error: '' };
  try {
    answer.sha256 = await digest(data.file);
  } catch (error) {
    answer.error = String(error);
  }
  self.postMessage(answer satisfies DigestAnswer);
};
