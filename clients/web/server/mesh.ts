// GET /api/mesh?model=M[&selection=S|&segment=ID&level=L][&complement=1][&format=NUMBER][&watertight=1]:
// ExportMesh as a file.
import type { IncomingMessage, ServerResponse } from 'node:http';
import { MeshFormat } from '../gen/pepeseg/v1/render_service_pb';
import { need } from './answer';
import type { BackEnd } from './back_end';
import { sendExport, subsetOf } from './exported_file';

export function getMesh(
  { channel }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  return sendExport(request, response, (query, options) => {
    const format = Number(query.get('format') ?? MeshFormat.PLY);
    const watertight = query.get('watertight') === '1';
    const subset = subsetOf(query);
    const asked = { model: need(query, 'model'), format, watertight, ...(subset && { subset }) };
    return channel.rendering.exportMesh(asked, options);
  });
}
