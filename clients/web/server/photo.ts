// GET /api/photo?parent=P[&name=N][&max_side=S][&frame=view]: GetPhotograph as a picture. `parent`:
// a dataset or a model; without a name, the first photograph of it.
import type { IncomingMessage, ServerResponse } from 'node:http';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import type {
  GetPhotographRequest,
  GetPhotographResponse_Header,
} from '../gen/pepeseg/v1/dataset_service_pb';
import { GetPhotographRequestSchema } from '../gen/pepeseg/v1/dataset_service_pb';
import { PixelFrame } from '../gen/pepeseg/v1/prompt_pb';
import { abortedWith, cacheControl, need, queryOf, sendError, wholeNumber, written } from './answer';
import type { BackEnd } from './back_end';
import { routing } from './channel';
import { passedOn } from './passed_on';

const frames: Record<string, PixelFrame> = {
  photograph: PixelFrame.PHOTOGRAPH,
  view: PixelFrame.VIEW,
};

/** Returns the request for a URL's query, or throws INVALID_ARGUMENT. */
export function photographRequest(query: URLSearchParams): GetPhotographRequest {
  const frame = frames[query.get('frame') ?? 'photograph'];
  if (frame === undefined) throw new ConnectError('frame is unknown', Code.InvalidArgument);
  return create(GetPhotographRequestSchema, {
    parent: need(query, 'parent'),
    photograph: query.get('name') ?? '',
    maxSide: wholeNumber(query, 'max_side'),
    frame,
  });
}

function begin(
  response: ServerResponse,
  { contentType, numBytes }: GetPhotographResponse_Header,
  parent: string,
): void {
  response.writeHead(200, {
    'content-type': contentType,
    'content-length': String(numBytes),
    'cache-control': cacheControl(parent),
  });
}

export async function getPhoto(
  { channel }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  const signal = abortedWith(response);
  try {
    const asked = photographRequest(queryOf(request));
    const options = { signal, timeoutMs: 120_000, headers: routing(asked.parent) };
    for await (const { part } of channel.datasets.getPhotograph(asked, options)) {
      if (part.case === 'header') {
        begin(response, part.value, asked.parent);
      } else if (part.case === 'chunk') {
        if (!(await written(response, part.value))) return;
      }
    }
    response.end();
  } catch (error) {
    sendError(response, passedOn(error, signal));
  }
}
