// GET /api/ply?model=M[&selection=S|&segment=ID&level=L][&complement=1][&format=NUMBER]: ExportGaussians as
// a file.
import type { IncomingMessage, ServerResponse } from 'node:http';
import { GaussianFormat } from '../gen/pepeseg/v1/render_service_pb';
import { need } from './answer';
import type { BackEnd } from './back_end';
import { sendExport, subsetOf } from './exported_file';

export function getPly(
  { channel }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  return sendExport(request, response, (query, options) => {
    const format = Number(query.get('format') ?? GaussianFormat.PLY);
    const subset = subsetOf(query);
    const asked = { model: need(query, 'model'), format, ...(subset && { subset }) };
    return channel.rendering.exportGaussians(asked, options);
  });
}
