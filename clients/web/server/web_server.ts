// The whole back end behind one HTTP listener.
import type { IncomingMessage, Server, ServerResponse } from 'node:http';
import { createServer } from 'node:http';
import { connectNodeAdapter } from '@connectrpc/connect-node';
import { WebSocketServer } from 'ws';
import type { BackEnd } from './back_end';
import type { Config } from './config';
import { refusal } from './guard';
import { getMesh } from './mesh';
import { getPhoto } from './photo';
import { getPicture } from './picture';
import { getPly } from './ply';
import { addRoutes } from './proxy';
import { serveSegmentStream } from './segment_socket';
import { sendFile } from './static_files';
import { putFile } from './upload';

type Way = (backEnd: BackEnd, request: IncomingMessage, response: ServerResponse) => Promise<void>;

const ways: Record<string, Way> = {
  'PUT /api/file': putFile,
  'GET /api/ply': getPly,
  'GET /api/mesh': getMesh,
  'GET /api/picture': getPicture,
  'GET /api/photo': getPhoto,
};

/** The same as the server's own limit. */
const maxMessageBytes = 8 << 20;

function common(response: ServerResponse): void {
  response.setHeader('x-content-type-options', 'nosniff');
  response.setHeader('referrer-policy', 'no-referrer');
  response.setHeader('cross-origin-resource-policy', 'same-origin');
  response.setHeader('cross-origin-opener-policy', 'same-origin');
}

export function createWebServer(config: Config, backEnd: BackEnd): Server {
  const rpc = connectNodeAdapter({
    routes: (router) => addRoutes(router, backEnd),
    requestPathPrefix: '/api/rpc',
    grpc: false,
    grpcWeb: false,
    readMaxBytes: maxMessageBytes,
  });
  const server = createServer((request, response) => {
    common(response);
    const refused = refusal(request, config.hosts);
    if (refused) {
      response.writeHead(403, { 'content-type': 'text/plain; charset=utf-8' }).end(refused);
      return;
    }
    const path = (request.url ?? '/').split('?')[0] ?? '/';
    const way = ways[`${request.method} ${path}`];
    if (way) return void way(backEnd, request, response);
    if (path.startsWith('/api/rpc/')) return rpc(request, response);
    if (path.startsWith('/api/')) return void response.writeHead(404).end();
    if (request.method === 'GET' || request.method === 'HEAD') {
      return void sendFile(config.appFolder, request, response);
    }
    response.writeHead(405).end();
  });
  // A video of gigabytes may take any time, headers may not.
  server.requestTimeout = 0;
  server.headersTimeout = 20_000;
  addSockets(server, config, backEnd);
  return server;
}

function addSockets(server: Server, config: Config, { channel }: BackEnd): void {
  const sockets = new WebSocketServer({ noServer: true, maxPayload: maxMessageBytes });
  server.on('upgrade', (request, socket, head) => {
    const path = (request.url ?? '/').split('?')[0];
    const named = request.headers.origin !== undefined;
    if (path !== '/api/segment-stream' || !named || refusal(request, config.hosts)) {
      socket.end('HTTP/1.1 403 Forbidden\r\nconnection: close\r\n\r\n');
      return;
    }
    sockets.handleUpgrade(request, socket, head, (open) => serveSegmentStream(channel, open));
  });
}
