// A pepesegd that requires keys, with its own data folder, and the app's back end with a key.
import type { ChildProcess } from 'node:child_process';
import { execFileSync, spawn } from 'node:child_process';
import {
  closeSync,
  existsSync,
  mkdirSync,
  mkdtempSync,
  openSync,
  readFileSync,
  rmSync,
  writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const web = resolve(dirname(fileURLToPath(import.meta.url)), '../..');
const root = resolve(web, '../..');
const bin = resolve(root, process.env.PEPESEG_BUILD ?? 'build', 'bin');

/** Folder for pictures of the screens, and logs. */
export const artefacts = resolve(root, process.env.PEPESEG_WEB_OUT ?? 'build/web-test');
export const shelf = join(root, 'tests/data/apc_shelf');

async function portIn(file: string, child: ChildProcess): Promise<number> {
  for (let i = 0; i < 600; ++i) {
    if (existsSync(file) && readFileSync(file, 'utf8') !== '')
      return Number(readFileSync(file, 'utf8'));
    if (child.exitCode !== null)
      throw new Error(`it ended with ${child.exitCode}: see ${artefacts}`);
    await new Promise((wake) => setTimeout(wake, 100));
  }
  throw new Error('it does not listen');
}

function start(program: string, args: string[], log: string): ChildProcess {
  const out = openSync(join(artefacts, log), 'a');
  const child = spawn(program, args, { stdio: ['ignore', out, out] });
  closeSync(out);
  return child;
}

async function ended(child: ChildProcess | undefined, signal: NodeJS.Signals): Promise<void> {
  if (!child || child.exitCode !== null || child.signalCode !== null) return;
  const over = new Promise((done) => child.once('exit', done));
  child.kill(signal);
  await over;
}

export class Stack {
  readonly key: string;
  private readonly folder = mkdtempSync(join(tmpdir(), 'pepeseg-web-'));
  private readonly data = join(this.folder, 'data');
  private server: ChildProcess | undefined;
  private web: ChildProcess | undefined;
  private serverPort = 0;
  private webPort = 0;

  constructor() {
    mkdirSync(artefacts, { recursive: true });
    mkdirSync(this.data);
    const scopes = 'read,write,train';
    const create = ['keys', 'create', '--data', this.data, '--project', 'lab', '--scopes', scopes];
    const key = /pk_\S+/.exec(
      execFileSync(join(bin, 'pepesegd'), create, { encoding: 'utf8', stdio: 'pipe' }),
    )?.[0];
    if (!key) throw new Error('pepesegd keys create prints no key');
    this.key = key;
    writeFileSync(join(this.folder, 'key'), `${key}\n`, { mode: 0o600 });
  }

  /** Starts the server; a second time on the same port. */
  async startServer(): Promise<void> {
    const portFile = join(this.folder, 'server.port');
    rmSync(portFile, { force: true });
    const listen = ['--listen', `127.0.0.1:${this.serverPort}`, '--port-file', portFile];
    // A job of a killed server is claimed again after the lease.
    const rest = ['--data', this.data, '--require-keys', '--lease-seconds', '5'];
    this.server = start(join(bin, 'pepesegd'), [...listen, ...rest], 'server.log');
    this.serverPort = await portIn(portFile, this.server);
  }

  killServer(): Promise<void> {
    return ended(this.server, 'SIGKILL');
  }

  async startWeb(): Promise<void> {
    const portFile = join(this.folder, 'web.port');
    const main = join(web, 'dist/server/main.js');
    const args = [
      main,
      '--server',
      `127.0.0.1:${this.serverPort}`,
      '--key-file',
      join(this.folder, 'key'),
    ];
    const listen = ['--listen', `127.0.0.1:${this.webPort}`, '--port-file', portFile];
    this.web = start(process.execPath, [...args, ...listen], 'web.log');
    this.webPort = await portIn(portFile, this.web);
  }

  get url(): string {
    return `http://127.0.0.1:${this.webPort}`;
  }

  async end(): Promise<void> {
    await ended(this.web, 'SIGTERM');
    await ended(this.server, 'SIGTERM');
    rmSync(this.folder, { recursive: true, force: true });
  }
}
