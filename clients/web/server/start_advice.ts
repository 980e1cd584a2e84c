// How to start a server if none listens.
import { accessSync, constants } from 'node:fs';
import { delimiter, dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

function isProgram(path: string): boolean {
  try {
    accessSync(path, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}

/** Finds pepesegd in this checkout's build, else on PATH; undefined if there is none. */
function findProgram(): string | undefined {
  const folders: string[] = [];
  for (let at = dirname(fileURLToPath(import.meta.url)); at !== dirname(at); at = dirname(at)) {
    folders.push(join(at, 'build', 'bin'));
  }
  folders.push(...(process.env.PATH ?? '').split(delimiter).filter(Boolean));
  return folders.map((folder) => join(folder, 'pepesegd')).find(isProgram);
}

/** Returns "start one with `COMMAND`"; empty for another machine, or if no program is found. */
export function startAdvice(address: string): string {
  const isHere = /^(127\.[\d.]+|localhost|\[?::1\]?):\d+$|^unix:/.test(address);
  const program = isHere ? findProgram() : undefined;
  if (!program) return '';
  const listen = address === '127.0.0.1:50051' ? '' : ` --listen ${address}`;
  return `start one with \`${program}${listen}\``;
}
