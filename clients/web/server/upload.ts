// PUT /api/file?upload=scenes/S/uploads/N&path=images/0001.jpg&offset=0: the bytes of one file from
// `offset` on. The browser gets the offset from GetUpload: the server keeps what it received before a
// connection was lost.
import type { IncomingMessage, ServerResponse } from 'node:http';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import type { WriteFilesRequest } from '../gen/pepeseg/v1/dataset_service_pb';
import { WriteFilesRequestSchema } from '../gen/pepeseg/v1/dataset_service_pb';
import { abortedWith, need, queryOf, sendError } from './answer';
import type { BackEnd } from './back_end';
import { routing } from './channel';
import { passedOn } from './passed_on';

const chunkBytes = 1 << 20;
/** Bytes of a refused body that are still read, so that the browser sees the answer. */
const politeBytes = 8 << 20;

function part(value: WriteFilesRequest['part']): WriteFilesRequest {
  return create(WriteFilesRequestSchema, { part: value });
}

/** Yields pieces of 1 MiB, whatever the sizes on the wire. */
export async function* pieces(body: AsyncIterable<Uint8Array>): AsyncGenerator<Uint8Array> {
  let waiting: Uint8Array[] = [];
  let size = 0;
  for await (const data of body) {
    for (let at = 0; at < data.length;) {
      const taken = data.subarray(at, at + chunkBytes - size);
      waiting.push(taken);
      size += taken.length;
      at += taken.length;
      if (size < chunkBytes) continue;
      yield Buffer.concat(waiting);
      waiting = [];
      size = 0;
    }
  }
  if (size > 0) yield Buffer.concat(waiting);
}

async function* messages(request: IncomingMessage): AsyncGenerator<WriteFilesRequest> {
  const query = queryOf(request);
  const offset = query.get('offset') ?? '0';
  const header = {
    upload: need(query, 'upload'),
    path: need(query, 'path'),
    offset: BigInt(offset),
  };
  yield part({ case: 'header', value: header as never });
  for await (const data of pieces(request)) {
    yield part({ case: 'chunk', value: data });
  }
  yield part({ case: 'end', value: {} as never });
}

/** Lets the browser finish sending, or closes the connection if too much is left. */
function drain(request: IncomingMessage): void {
  let left = politeBytes;
  request.on('data', (data: Buffer) => {
    left -= data.length;
    if (left < 0) request.destroy();
  });
  request.resume();
}

export async function putFile(
  { channel }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  const signal = abortedWith(response);
  try {
    const query = queryOf(request);
    const upload = need(query, 'upload');
    const offset = query.get('offset') ?? '0';
    if (!/^\d{1,15}$/.test(offset)) {
      throw new ConnectError('offset is not a number of bytes', Code.InvalidArgument);
    }
    await channel.datasets.writeFiles(messages(request), {
      signal,
      headers: routing(upload),
    });
    response.writeHead(200, { 'content-type': 'application/json' }).end('{}');
  } catch (error) {
    sendError(response, passedOn(error, signal));
    if (!request.complete) drain(request);
  }
}
