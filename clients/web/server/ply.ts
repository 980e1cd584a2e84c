// GET /api/ply?model=M[&selection=S|&segment=ID&level=L][&complement=1][&format=NUMBER]: ExportGaussians as
// a file. A segment is one of the decomposition at the default scales.
import type { IncomingMessage, ServerResponse } from 'node:http';
import { create } from '@bufbuild/protobuf';
import type {
  ExportGaussiansRequest,
  ExportGaussiansResponse_Header,
} from '../gen/pepeseg/v1/render_service_pb';
import {
  ExportGaussiansRequestSchema,
  GaussianFormat,
  SubsetSchema,
} from '../gen/pepeseg/v1/render_service_pb';
import { abortedWith, cacheControl, need, queryOf, sendError, wholeNumber, written } from './answer';
import type { BackEnd } from './back_end';
import { routing } from './channel';
import { passedOn } from './passed_on';

function exportRequest(query: URLSearchParams): ExportGaussiansRequest {
  const format = Number(query.get('format') ?? GaussianFormat.PLY);
  const request = create(ExportGaussiansRequestSchema, { model: need(query, 'model'), format });
  const selection = query.get('selection');
  const id = wholeNumber(query, 'segment');
  const complement = query.get('complement') === '1';
  if (selection) {
    request.subset = create(SubsetSchema, { of: { case: 'selection', value: selection }, complement });
  } else if (id > 0) {
    const segment = { level: wholeNumber(query, 'level'), id };
    request.subset = create(SubsetSchema, { of: { case: 'segment', value: segment }, complement });
  }
  return request;
}

function begin(
  response: ServerResponse,
  header: ExportGaussiansResponse_Header,
  query: URLSearchParams,
): void {
  response.writeHead(200, {
    'content-type': 'application/octet-stream',
    'content-length': String(header.numBytes),
    etag: `"${header.sha256}"`,
    'x-gaussians': String(header.numGaussians),
    'cache-control': cacheControl(need(query, 'model')),
  });
}

export async function getPly(
  { channel }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  const query = queryOf(request);
  const signal = abortedWith(response);
  try {
    const stream = channel.rendering.exportGaussians(exportRequest(query), {
      signal,
      headers: routing(need(query, 'model')),
    });
    for await (const { part } of stream) {
      if (part.case === 'header') {
        begin(response, part.value, query);
      } else if (part.case === 'chunk') {
        if (!(await written(response, part.value))) return;
      }
    }
    response.end();
  } catch (error) {
    sendError(response, passedOn(error, signal));
  }
}
