// Allows only pages that this back end served. The back end holds a key: another site's page that made
// a browser send requests here would act with it.
import type { IncomingMessage } from 'node:http';

/** Returns why a request is refused, or undefined. CORS is closed: no answer allows an origin. */
export function refusal(request: IncomingMessage, hosts: ReadonlySet<string>): string | undefined {
  const host = request.headers.host ?? '';
  // A foreign host name that points here (DNS rebinding) would make its page "same origin".
  if (!hosts.has(host.replace(/:\d+$/, ''))) {
    return `unknown host ${JSON.stringify(host)}: name it with --host when the app is started`;
  }
  const site = request.headers['sec-fetch-site'];
  if (site !== undefined && site !== 'same-origin' && site !== 'none') {
    return 'requests of other sites are refused';
  }
  const origin = request.headers.origin;
  if (origin !== undefined && !isOfHost(origin, host)) {
    return 'requests of other origins are refused';
  }
  return undefined;
}

function isOfHost(origin: string, host: string): boolean {
  try {
    return new URL(origin).host === host;
  } catch {
    return false; // "null" from a sandboxed frame, or not a URL
  }
}
