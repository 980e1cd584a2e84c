// The photographs that were uploaded through this back end, kept to be looked at: the contract brings
// none back. They are pictures only: what is trained and asked about is what the server has.
import { createHash } from 'node:crypto';
import type { FileHandle } from 'node:fs/promises';
import { mkdir, open, readdir, rename, rm } from 'node:fs/promises';
import { join } from 'node:path';

const photograph = /^images\/.*\.(jpe?g|png|webp)$/i;

/** Of an upload or a scene: its id; undefined: it is no name of one. */
function sceneIdOf(resource: string): string | undefined {
  return /^scenes\/([A-Za-z0-9][\w.-]{0,62})(\/|$)/.exec(resource)?.[1];
}

/** As the server names folders: ids that differ in case only must not share one anywhere. */
function folderName(id: string): string {
  return id.replace(/[A-Z_.]/g, (c) => (c === '_' ? '__' : c === '.' ? '_-' : `_${c.toLowerCase()}`));
}

/** A path of a client never becomes one of this machine. */
function fileName(path: string): string {
  return createHash('sha256').update(path).digest('hex').slice(0, 40);
}

/** Writes along while a photograph is sent; what fails here fails nothing else. */
export class PhotographCopy {
  private failed = false;

  private constructor(
    private readonly file: FileHandle,
    private readonly path: string,
    private position: number,
  ) {}

  static async begin(path: string, offset: number): Promise<PhotographCopy | undefined> {
    try {
      const file = await open(`${path}.part`, offset === 0 ? 'w' : 'r+');
      const { size } = await file.stat();
      if (size >= offset) return new PhotographCopy(file, path, offset);
      await file.close(); // its beginning went another way
    } catch {
      // No folder, no space, no beginning: then there is no copy.
    }
    return undefined;
  }

  async add(data: Uint8Array): Promise<void> {
    if (this.failed) return;
    try {
      await this.file.write(data, 0, data.length, this.position);
      this.position += data.length;
    } catch {
      this.failed = true;
    }
  }

  async end(whole: boolean): Promise<void> {
    try {
      if (whole && !this.failed) await this.file.truncate(this.position);
      await this.file.close();
      if (whole && !this.failed) await rename(`${this.path}.part`, this.path);
    } catch {
      // As above.
    }
  }
}

export class Photographs {
  constructor(private readonly folder: string) {}

  /** Undefined: the file is no photograph, or cannot be kept. */
  async copy(upload: string, path: string, offset: number): Promise<PhotographCopy | undefined> {
    const scene = sceneIdOf(upload);
    if (!scene || !photograph.test(path)) return undefined;
    const folder = join(this.folder, folderName(scene));
    const made = await mkdir(folder, { recursive: true, mode: 0o700 }).then(
      () => true,
      () => false,
    );
    return made ? PhotographCopy.begin(join(folder, fileName(path)), offset) : undefined;
  }

  /** `path`: empty for any one of the scene. To be closed; undefined: there is none. */
  async find(scene: string, path: string): Promise<FileHandle | undefined> {
    const id = sceneIdOf(scene);
    if (!id) return undefined;
    const folder = join(this.folder, folderName(id));
    try {
      const name = path === '' ? await this.first(folder) : fileName(path);
      return name ? await open(join(folder, name), 'r') : undefined;
    } catch {
      return undefined;
    }
  }

  async forget(scene: string): Promise<void> {
    const id = sceneIdOf(scene);
    if (id)
      await rm(join(this.folder, folderName(id)), { recursive: true, force: true }).catch(() => undefined);
  }

  private async first(folder: string): Promise<string | undefined> {
    return (await readdir(folder)).filter((name) => !name.endsWith('.part')).sort()[0];
  }
}
