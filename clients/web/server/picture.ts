// GET /api/picture?model=M&view=V[&content=color|features|segments][&level=L][&max_side=S]: a view of a
// model as a picture, in the pixels of its photograph. Segments are ids as 16-bit grey.
import type { IncomingMessage, ServerResponse } from 'node:http';
import { create } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { RenderViewRequest_Content, RenderViewRequestSchema } from '../gen/pepeseg/v1/render_service_pb';
import { abortedWith, cacheControl, need, queryOf, sendError, wholeNumber } from './answer';
import type { BackEnd } from './back_end';
import { routing } from './channel';
import { passedOn } from './passed_on';

const contents: Record<string, RenderViewRequest_Content> = {
  color: RenderViewRequest_Content.COLOR,
  features: RenderViewRequest_Content.FEATURES,
  segments: RenderViewRequest_Content.SEGMENTS,
};

export async function getPicture(
  { channel }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  const query = queryOf(request);
  const signal = abortedWith(response);
  try {
    const model = need(query, 'model');
    const content = contents[query.get('content') ?? 'color'];
    const maxSide = wholeNumber(query, 'max_side');
    if (content === undefined) throw new ConnectError('content is unknown', Code.InvalidArgument);
    const rendered = await channel.rendering.renderView(
      create(RenderViewRequestSchema, {
        model,
        content,
        maxSide,
        level: wholeNumber(query, 'level'),
        featureScale: Number(query.get('scale') ?? '0.5'),
        viewpoint: { place: { case: 'view', value: need(query, 'view') } },
      }),
      { signal, timeoutMs: 60_000, headers: routing(model) },
    );
    response.writeHead(200, {
      'content-type': 'image/png',
      'content-length': rendered.png.length,
      'cache-control': cacheControl(model),
    });
    response.end(rendered.png);
  } catch (error) {
    sendError(response, passedOn(error, signal));
  }
}
