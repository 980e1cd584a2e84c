// Fetches a file from the back end, and reports how far it is.
import { Code, ConnectError } from '@connectrpc/connect';
import { GrowingFile } from './growing_file';
import { routeError } from './route_error';
import { steadily } from './server_link';

export interface FetchWatch {
  /** Called with bytes; `total` 0: not known. May throw to end the fetch. */
  readonly progress: (done: number, total: number) => void;
  readonly signal: AbortSignal;
}

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
  const file = new GrowingFile();
  const reader = answer.body?.getReader();
  try {
    progress(0, total);
    for (let part = await reader?.read(); part && !part.done; part = await reader?.read()) {
      file.add(part.value);
      progress(file.size, total);
    }
  } catch (error) {
    await reader?.cancel().catch(() => undefined);
    signal.throwIfAborted();
    const reason = error instanceof Error ? error.message : String(error);
    throw new ConnectError(`the file was cut off after ${file.size} bytes: ${reason}`, Code.DataLoss);
  }
  if (total > 0 && file.size !== total) {
    throw new ConnectError(`the file has ${file.size} bytes instead of ${total}`, Code.DataLoss);
  }
  return file.whole('application/octet-stream');
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
