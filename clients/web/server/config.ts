// Where the back end listens and which server it speaks for.
import { readFileSync } from 'node:fs';
import { parseArgs } from 'node:util';

export interface Config {
  readonly listenHost: string;
  readonly listenPort: number;
  /** Base URL of pepesegd or of the gateway: http:// or https://. */
  readonly serverUrl: string;
  /** The key of every call; undefined: the server needs none. */
  readonly key: string | undefined;
  readonly tls: { ca?: string; cert?: string; key?: string };
  /** Host names under which browsers may reach the app, without port. */
  readonly hosts: ReadonlySet<string>;
  /** Folder of the built app. */
  readonly appFolder: string;
  /** File that gets the port when the back end listens; for tests. */
  readonly portFile: string | undefined;
}

/** A wrong command line or environment, which is printed without a stack. */
export class ConfigError extends Error {}

export const usage = `pepeseg's web app
  node dist/server/main.js [options]
  --listen HOST:PORT       127.0.0.1:8080; port 0 takes a free one
  --server ADDRESS         pepesegd or the gateway: host:port or https://host:port;
                           PEPESEG_SERVER, else 127.0.0.1:50051
  --key-file FILE          file with the API key or token in its first line; else PEPESEG_KEY
  --ca FILE                trusted certificates (PEM); implies TLS
  --certificate FILE --certificate-key FILE   shown to the server
  --host NAME              another host name of the app in browsers; may be repeated
  --behind-login           allow other machines: a proxy in front of it asks who calls
  --port-file FILE         file to which the port is written`;

const loopback = /^(localhost|127(\.\d{1,3}){3}|\[::1\]|::1)$/;

/** Splits "host:port" or "[::1]:port". */
export function splitAddress(address: string): { host: string; port: number } {
  const match = /^(.*):(\d{1,5})$/.exec(address);
  const port = Number(match?.[2]);
  if (!match?.[1] || port > 65535) throw new ConfigError(`${address}: not host:port`);
  return { host: match[1], port };
}

function readText(file: string): string {
  try {
    return readFileSync(file, 'utf8');
  } catch (error) {
    throw new ConfigError(`${file}: cannot be read (${(error as NodeJS.ErrnoException).code})`);
  }
}

function findKey(file: string | undefined, env: NodeJS.ProcessEnv): string | undefined {
  const text = file === undefined ? env.PEPESEG_KEY : readText(file).split('\n')[0];
  const key = text?.trim();
  if (!key && file === undefined) return undefined;
  // A key that cannot be a header value would fail each call with an error that names nothing.
  if (!key || !/^(pk_[\x21-\x7e]+|[\w-]+\.[\w-]+\.[\w-]+)$/.test(key)) {
    throw new ConfigError(`${file ?? 'PEPESEG_KEY'}: holds no key (pk_...) and no token (JWT)`);
  }
  return key;
}

export function readConfig(args: string[], env: NodeJS.ProcessEnv, appFolder: string): Config {
  const { values } = parse(args);
  const listen = splitAddress(values.listen ?? '127.0.0.1:8080');
  if (!loopback.test(listen.host) && !values['behind-login']) {
    throw new ConfigError(
      `${listen.host} is reached from other machines, and whoever reaches the app acts with its ` +
        'key: put a proxy that asks who calls in front of it, and say so with --behind-login',
    );
  }
  const tls = {
    ...(values.ca && { ca: readText(values.ca) }),
    ...(values.certificate && { cert: readText(values.certificate) }),
    ...(values['certificate-key'] && { key: readText(values['certificate-key']) }),
  };
  if (!tls.cert !== !tls.key) {
    throw new ConfigError('--certificate and --certificate-key are given together or not at all');
  }
  const server = values.server ?? env.PEPESEG_SERVER ?? '127.0.0.1:50051';
  const isHttps = server.startsWith('https://') || Object.keys(tls).length > 0;
  const address = splitAddress(server.replace(/^https?:\/\//, ''));
  const key = findKey(values['key-file'], env);
  if (key && !isHttps && !loopback.test(address.host)) {
    throw new ConfigError(`the key is not sent to ${server}: the connection is not encrypted`);
  }
  return {
    listenHost: listen.host.replace(/^\[|\]$/g, ''),
    listenPort: listen.port,
    serverUrl: `${isHttps ? 'https' : 'http'}://${address.host}:${address.port}`,
    key,
    tls,
    hosts: new Set(['localhost', '127.0.0.1', '[::1]', ...(values.host ?? [])]),
    appFolder,
    portFile: values['port-file'],
  };
}

function parse(args: string[]) {
  try {
    return parseArgs({
      args,
      options: {
        listen: { type: 'string' },
        server: { type: 'string' },
        'key-file': { type: 'string' },
        ca: { type: 'string' },
        certificate: { type: 'string' },
        'certificate-key': { type: 'string' },
        host: { type: 'string', multiple: true },
        'behind-login': { type: 'boolean' },
        'port-file': { type: 'string' },
      },
    });
  } catch (error) {
    throw new ConfigError(`${(error as Error).message}\n${usage}`);
  }
}
