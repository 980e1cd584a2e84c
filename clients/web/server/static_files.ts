// Serves the built app from the disk. A path that is not a file is a screen, which the app chooses.
import { createReadStream } from 'node:fs';
import { stat } from 'node:fs/promises';
import type { IncomingMessage, ServerResponse } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { sendAll } from './answer';

const types: Record<string, string> = {
  '.html': 'text/html; charset=utf-8',
  '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8',
  '.svg': 'image/svg+xml',
  '.wasm': 'application/wasm',
  '.png': 'image/png',
};

// Spark runs WebAssembly from a data URL, and sorts in workers that it makes from blobs.
const contentSecurity = [
  "default-src 'self'",
  "script-src 'self' 'wasm-unsafe-eval'",
  "style-src 'self' 'unsafe-inline'",
  "img-src 'self' blob: data:",
  "connect-src 'self' blob: data:",
  "worker-src 'self' blob:",
  "object-src 'none'",
  "base-uri 'none'",
  "form-action 'none'",
  "frame-ancestors 'none'",
].join('; ');

export async function sendFile(
  folder: string,
  request: IncomingMessage,
  response: ServerResponse,
): Promise<void> {
  let path = '/';
  try {
    path = decodeURIComponent(new URL(request.url ?? '/', 'http://app').pathname);
  } catch {
    response.writeHead(400).end();
    return;
  }
  const inside = normalize(path).replace(/^([/\\]|\.\.)+/, '');
  const file = join(folder, inside);
  const found = inside !== '' && (await stat(file).catch(() => undefined))?.isFile() === true;
  if (!found && extname(inside) !== '' && inside.startsWith('assets/')) {
    response.writeHead(404).end();
    return;
  }
  const sent = found ? file : join(folder, 'index.html');
  response.writeHead(200, {
    'content-type': types[extname(sent)] ?? 'application/octet-stream',
    // Vite names its output files by their content.
    'cache-control': inside.startsWith('assets/')
      ? 'public, max-age=31536000, immutable'
      : 'no-cache',
    'content-security-policy': contentSecurity,
  });
  if (request.method === 'HEAD') {
    response.end();
    return;
  }
  await sendAll(response, createReadStream(sent));
}
