// GET /api/photo?scene=scenes/S[&path=images/0001.jpg]: a photograph as it was uploaded, if this back
// end has it and its key may see the scene; without a path, any one of the scene.
import type { FileHandle } from 'node:fs/promises';
import type { IncomingMessage, ServerResponse } from 'node:http';
import { Code, ConnectError } from '@connectrpc/connect';
import { abortedWith, need, queryOf, sendAll, sendError } from './answer';
import type { BackEnd } from './back_end';
import { routing } from './channel';
import { passedOn } from './passed_on';

function typeOf(head: Uint8Array): string | undefined {
  if (head[0] === 0xff && head[1] === 0xd8) return 'image/jpeg';
  if (head[0] === 0x89 && head[1] === 0x50) return 'image/png';
  if (head[0] === 0x52 && head[8] === 0x57) return 'image/webp';
  return undefined;
}

export async function getPhoto(
  { channel, photographs }: BackEnd,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  const query = queryOf(request);
  const signal = abortedWith(response);
  let file: FileHandle | undefined;
  try {
    const scene = need(query, 'scene');
    const options = { signal, timeoutMs: 10_000, headers: routing(scene) };
    await channel.scenes.getScene({ name: scene }, options);
    file = await photographs.find(scene, query.get('path') ?? '');
    if (!file) throw new ConnectError('this photograph was not uploaded here', Code.NotFound);
    const head = new Uint8Array(12);
    await file.read(head, 0, head.length, 0);
    const type = typeOf(head);
    if (!type) throw new ConnectError('the file is no photograph', Code.NotFound);
    response.writeHead(200, {
      'content-type': type,
      'content-length': (await file.stat()).size,
      // The same name may be uploaded anew, with another dataset.
      'cache-control': 'private, max-age=60',
    });
    await sendAll(response, file.createReadStream({ start: 0 }));
  } catch (error) {
    sendError(response, passedOn(error, signal));
  } finally {
    await file?.close();
  }
}
