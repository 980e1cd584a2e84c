// Files that the server exports: a header with size and SHA-256, then chunks.
import { createHash } from 'node:crypto';
import type { IncomingMessage, ServerResponse } from 'node:http';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import type { Subset } from '../gen/pepeseg/v1/render_service_pb';
import { SubsetSchema } from '../gen/pepeseg/v1/render_service_pb';
import { abortedWith, cacheControl, need, queryOf, sendError, wholeNumber, written } from './answer';
import { routing } from './channel';
import { passedOn } from './passed_on';

interface Header {
  readonly numBytes: bigint;
  readonly sha256: string;
}

interface Message {
  readonly part:
    | { readonly case: 'header'; readonly value: Header }
    | { readonly case: 'chunk'; readonly value: Uint8Array }
    | { readonly case: undefined };
}

interface CallOptions {
  readonly signal: AbortSignal;
  readonly headers: Record<string, string>;
}

/** Returns the Gaussians that a query is about; undefined: all. Segments are of the default scales. */
export function subsetOf(query: URLSearchParams): Subset | undefined {
  const selection = query.get('selection');
  const id = wholeNumber(query, 'segment');
  const complement = query.get('complement') === '1';
  if (selection) {
    return create(SubsetSchema, { of: { case: 'selection', value: selection }, complement });
  }
  if (id === 0) return undefined;
  const segment = { level: wholeNumber(query, 'level'), id };
  return create(SubsetSchema, { of: { case: 'segment', value: segment }, complement });
}

/**
 * Sends the file. The last chunk waits for the check of all bytes: a damaged file of one chunk is an error,
 * a larger one is cut off.
 */
async function forward(
  stream: AsyncIterable<Message>,
  response: ServerResponse,
  model: string,
): Promise<void> {
  const hash = createHash('sha256');
  let header: Header | undefined;
  let last: Uint8Array | undefined;
  const begin = () => {
    if (!header || response.headersSent) return;
    response.writeHead(200, {
      'content-type': 'application/octet-stream',
      'content-length': String(header.numBytes),
      etag: `"${header.sha256}"`,
      'cache-control': cacheControl(model),
    });
  };
  for await (const { part } of stream) {
    if (part.case === 'header') {
      header = part.value;
    } else if (part.case === 'chunk') {
      hash.update(part.value);
      if (last) {
        begin();
        if (!(await written(response, last))) return;
      }
      last = part.value;
    }
  }
  if (hash.digest('hex') !== header?.sha256) {
    throw new ConnectError('the exported file was damaged on the way', Code.DataLoss);
  }
  begin();
  response.end(last);
}

/** Answers with the file that a call streams. `call` gets the query, and may throw what is wrong with it. */
export async function sendExport(
  request: IncomingMessage,
  response: ServerResponse,
  call: (query: URLSearchParams, options: CallOptions) => AsyncIterable<Message>,
): Promise<void> {
  const query = queryOf(request);
  const signal = abortedWith(response);
  try {
    const model = need(query, 'model');
    await forward(call(query, { signal, headers: routing(model) }), response, model);
  } catch (error) {
    sendError(response, passedOn(error, signal));
  }
}
