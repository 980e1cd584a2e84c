// Answers of the routes that are not RPCs.
import type { IncomingMessage, ServerResponse } from 'node:http';
import type { Readable } from 'node:stream';
import { pipeline } from 'node:stream/promises';
import { Code, ConnectError } from '@connectrpc/connect';
import { detailOf } from '../contract/error_detail';

const httpStatus: Partial<Record<Code, number>> = {
  [Code.InvalidArgument]: 400,
  [Code.Unauthenticated]: 401,
  [Code.PermissionDenied]: 403,
  [Code.NotFound]: 404,
  [Code.Aborted]: 409,
  [Code.AlreadyExists]: 409,
  [Code.FailedPrecondition]: 412,
  [Code.OutOfRange]: 416,
  [Code.ResourceExhausted]: 429,
  [Code.Unavailable]: 503,
  [Code.DeadlineExceeded]: 504,
};

/** Answers with JSON: the gRPC code's number, the message, and the useful part of the details. */
export function sendError(response: ServerResponse, error: unknown): void {
  const from = ConnectError.from(error);
  if (response.headersSent) {
    response.destroy(); // the reader sees that the body is cut short
    return;
  }
  const detail = detailOf(from);
  const body = {
    code: from.code,
    message: from.rawMessage,
    ...(detail && {
      detail: {
        reason: detail.reason,
        resource: detail.resource,
        limit: detail.limit,
        value: detail.value,
      },
    }),
  };
  response.writeHead(httpStatus[from.code] ?? 500, {
    'content-type': 'application/json',
    'cache-control': 'no-store',
  });
  response.end(JSON.stringify(body));
}

/** Returns how long browsers keep what is made of a model, a job's newest state, or a dataset. */
export function cacheControl(resource: string): string {
  // A model and a dataset never change; the model named "live", and that of a job, do.
  const changes = resource.endsWith('/live') || resource.startsWith('jobs/');
  return changes ? 'no-store' : 'private, max-age=86400, immutable';
}

export function queryOf(request: IncomingMessage): URLSearchParams {
  return new URL(request.url ?? '/', 'http://app').searchParams;
}

export function need(query: URLSearchParams, name: string): string {
  const value = query.get(name);
  if (!value) throw new ConnectError(`${name} is missing`, Code.InvalidArgument);
  return value;
}

/** Returns a parameter that is a whole number of at most five digits; 0 without it. */
export function wholeNumber(query: URLSearchParams, name: string): number {
  const value = query.get(name) ?? '0';
  if (!/^\d{1,5}$/.test(value)) {
    throw new ConnectError(`${name} is not a whole number below 100000`, Code.InvalidArgument);
  }
  return Number(value);
}

/** Aborts the work for a request when its reader goes away. */
export function abortedWith(response: ServerResponse): AbortSignal {
  const controller = new AbortController();
  if (response.destroyed) controller.abort();
  response.on('close', () => controller.abort());
  return controller.signal;
}

/** Sends a whole file, and closes it in any case: the reader may leave before the end. */
export async function sendAll(response: ServerResponse, file: Readable): Promise<void> {
  await pipeline(file, response).catch(() => response.destroy());
}

/** Waits until the reader has taken what was written. Returns false if it has gone. */
export async function written(response: ServerResponse, data: Uint8Array): Promise<boolean> {
  if (response.destroyed) return false;
  if (response.write(data)) return true;
  await new Promise<void>((resolve) => {
    const done = () => {
      response.off('drain', done);
      response.off('close', done);
      resolve();
    };
    response.on('drain', done);
    response.on('close', done);
  });
  return !response.destroyed;
}
