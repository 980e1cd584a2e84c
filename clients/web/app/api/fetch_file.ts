// Fetches a file from the back end, and reports how far it is.
import { Code, ConnectError } from '@connectrpc/connect';
import { routeError } from './route_error';
import { steadily } from './server_link';

export interface FetchWatch {
  /** Called with bytes; `total` 0: not known. May throw to end the fetch. */
  readonly progress: (done: number, total: number) => void;
  readonly signal: AbortSignal;
}

/** Bytes that become a Blob at a time: browsers keep large Blobs on the disk, arrays in memory. */
const pieceBytes = 16 << 20;

async function answerFrom(url: string, signal: AbortSignal): Promise<Response> {
  const answer = await fetch(url, { signal });
  if (!answer.ok) throw routeError(answer.status, await answer.text());
  return answer;
}

/** Returns the number of bytes that will come; 0: not known, as after compression by a proxy. */
function totalOf({ headers }: Response): number {
  if (headers.has('content-encoding')) return 0;
  return Number(headers.get('content-length') ?? 0);
}

async function bodyOf(answer: Response, { progress, signal }: FetchWatch): Promise<Blob> {
  const total = totalOf(answer);
  const pieces: Blob[] = [];
  let chunks: Uint8Array<ArrayBuffer>[] = [];
  let done = 0;
  let pending = 0;
  const reader = answer.body?.getReader();
  try {
    progress(0, total);
    for (let part = await reader?.read(); part && !part.done; part = await reader?.read()) {
      chunks.push(part.value);
      done += part.value.length;
      pending += part.value.length;
      if (pending >= pieceBytes) {
        pieces.push(new Blob(chunks));
        chunks = [];
        pending = 0;
      }
      progress(done, total);
    }
  } catch (error) {
    await reader?.cancel().catch(() => undefined);
    signal.throwIfAborted();
    const reason = error instanceof Error ? error.message : String(error);
    throw new ConnectError(`the file was cut off after ${done} bytes: ${reason}`, Code.DataLoss);
  }
  if (total > 0 && done !== total) {
    throw new ConnectError(`the file has ${done} bytes instead of ${total}`, Code.DataLoss);
  }
  return new Blob([...pieces, ...chunks], { type: 'application/octet-stream' });
}

/**
 * Returns a file of the back end. The request is repeated until the server answers; a file that is
 * cut off is DATA_LOSS, never a shorter file.
 */
export async function fetchFile(url: string, watch: FetchWatch): Promise<Blob> {
  const { progress, signal } = watch;
  progress(0, 0);
  return bodyOf(await steadily(() => answerFrom(url, signal), signal), watch);
}
