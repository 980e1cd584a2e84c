// Who may ask: pages that this back end served, and nobody else. It holds a key, so that another
// site's page that could make a browser send requests here would act with it.
import type { IncomingMessage } from 'node:http';

/** Why a request is refused; undefined: it may pass. CORS is closed: no answer allows an origin. */
export function refusal(request: IncomingMessage, hosts: ReadonlySet<string>): string | undefined {
  const host = request.headers.host ?? '';
  // A name of somebody else's that points here (DNS rebinding) would make their page "same origin".
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
    return false; // "null" of a sandboxed frame, or no URL at all
  }
}
