// Sends one file to the back end, from a byte on. XMLHttpRequest, because fetch reports no progress.
import { Code, ConnectError } from '@connectrpc/connect';
import { routeError } from '../api/route_error';

export interface Sending {
  upload: string;
  path: string;
  offset: number;
  /** The whole file. */
  file: Blob;
  /** Called with the number of the file's bytes that were sent. */
  progress: (bytes: number) => void;
  signal: AbortSignal;
}

export function sendFile({ upload, path, offset, file, progress, signal }: Sending): Promise<void> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const where = new URLSearchParams({ upload, path, offset: String(offset) });
    request.open('PUT', `/api/file?${where}`);
    request.setRequestHeader('content-type', 'application/octet-stream');
    request.upload.onprogress = (event) => progress(offset + event.loaded);
    request.onload = () =>
      request.status === 200 ? resolve() : reject(routeError(request.status, request.responseText));
    request.onerror = () =>
      reject(new ConnectError('The server does not answer', Code.Unavailable));
    request.onabort = () => reject(new DOMException('given up', 'AbortError'));
    signal.addEventListener('abort', () => request.abort(), { once: true });
    request.send(offset === 0 ? file : file.slice(offset));
  });
}
