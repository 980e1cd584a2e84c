// Which dropped files are part of a dataset, and what each is: the layout of the command-line client
// (clients/cli/README.md).
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
import {
  inLayout,
  isPhotograph,
  isReadableName,
  isSystemFile,
  isVideo,
  kindOf,
  sceneFolder,
} from './dataset_layout';
import { beginsAsPhotograph, beginsAsVideo } from './file_signature';
import { transformsReferences } from './transforms_references';

/** A dropped file with its path, such as "garden/images/0001.jpg". */
export interface DroppedFile {
  readonly path: string;
  readonly file: File;
}

export interface DatasetFile {
  /** Path below the scene's folder, such as "images/0001.jpg". */
  readonly path: string;
  readonly kind: FileKind;
  readonly file: File;
  /** True for a MASK that transforms.json names: its pixels of value 0 are ignored. */
  readonly ignores?: boolean;
}

export interface Dataset {
  readonly files: DatasetFile[];
  /** Paths of files that are not part of a dataset. */
  readonly leftOut: string[];
  /** Paths of files that have the name of a photograph or a video, and other content. */
  readonly notPictures: string[];
  /** Paths of files whose names are not UTF-8. */
  readonly unreadableNames: string[];
  /** Folder of photographs or videos that are left out, if none are taken. */
  readonly picturesElsewhere: string | undefined;
}

/** A file while it is sorted. */
interface Found {
  /** Path below the scene's folder, as it was dropped. */
  readonly below: string;
  readonly file: File;
}

interface Taken extends DatasetFile, Found {}

function hasPictures(files: readonly DatasetFile[]): boolean {
  return files.some(({ kind }) => kind === FileKind.IMAGE || kind === FileKind.VIDEO);
}

/** Returns the kinds of the files that transforms.json names, by path in lower case. */
async function referencesOf(found: readonly Found[]): Promise<ReadonlyMap<string, FileKind>> {
  const transforms = found.find(({ below }) => below === 'transforms.json');
  return transforms ? transformsReferences(await transforms.file.text()) : new Map();
}

/** Returns the file as a part of the dataset; undefined if it is none. */
function takeFile(found: Found, named: ReadonlyMap<string, FileKind>): Taken | undefined {
  const path = inLayout(found.below);
  const reference = named.get(found.below.toLowerCase());
  const byName = kindOf(path);
  // A mask among the photographs is none of them.
  const isMask = byName === FileKind.IMAGE && reference === FileKind.MASK;
  const kind = isMask ? reference : (byName ?? reference);
  // Some tools write no points at all, and the contract has no files without bytes.
  const empty = kind === FileKind.POINTS && found.file.size === 0;
  if (kind === undefined || empty) return undefined;
  const ignores = kind === FileKind.MASK && reference === FileKind.MASK;
  return { ...found, path, kind, ...(ignores && { ignores }) };
}

/** Returns a photograph or video in the scene's folder itself as a part of the dataset. */
function takeLoose(found: Found): Taken | undefined {
  const { below } = found;
  if (below.includes('/')) return undefined;
  if (isPhotograph(below)) return { ...found, path: `images/${below}`, kind: FileKind.IMAGE };
  if (isVideo(below)) return { ...found, path: `videos/${below}`, kind: FileKind.VIDEO };
  return undefined;
}

/** Returns the files that `take` takes, and the rest. */
function split(
  found: readonly Found[],
  take: (file: Found) => Taken | undefined,
): { files: Taken[]; rest: Found[] } {
  const files: Taken[] = [];
  const rest: Found[] = [];
  for (const file of found) {
    const taken = take(file);
    if (taken) files.push(taken);
    else rest.push(file);
  }
  return { files, rest };
}

const stem = (path: string) => path.replace(/\.[^./]*$/, '').toLowerCase();

/** Drops the videos of Live Photos, which have the name of a photograph next to them. */
function withoutLivePhotos(files: readonly Taken[]): Taken[] {
  const photographs = new Set(
    files.filter(({ kind }) => kind === FileKind.IMAGE).map(({ below }) => stem(below)),
  );
  return files.filter(
    ({ kind, below }) => kind !== FileKind.VIDEO || !photographs.has(stem(below)),
  );
}

async function isAsNamed({ kind, file }: DatasetFile): Promise<boolean> {
  if (kind === FileKind.IMAGE) return beginsAsPhotograph(file);
  return kind !== FileKind.VIDEO || beginsAsVideo(file);
}

function folderOfPictures(found: readonly Found[]): string | undefined {
  const paths = found
    .map(({ below }) => below)
    .filter((path) => isPhotograph(path) || isVideo(path));
  return paths.sort()[0]?.split('/').slice(0, -1).join('/');
}

export async function readDataset(dropped: readonly DroppedFile[]): Promise<Dataset> {
  const ours = dropped.filter(({ path }) => !isSystemFile(path));
  const named = ours.filter(({ path }) => isReadableName(path));
  const root = sceneFolder(named.map(({ path }) => path));
  const found = named.map(({ path, file }) => ({ below: path.slice(root.length), file }));
  // Before loose photographs are taken, because a mask that transforms.json names may be next to them.
  const references = await referencesOf(found);
  let { files, rest } = split(found, (file) => takeFile(file, references));
  if (!hasPictures(files)) {
    const loose = split(rest, takeLoose);
    files = [...files, ...loose.files];
    rest = loose.rest;
  }
  const asNamed = await Promise.all(files.map(isAsNamed));
  const readable = files.filter((_, i) => asNamed[i]);
  const taken = withoutLivePhotos(readable);
  const live = readable.filter((file) => !taken.includes(file));
  return {
    files: taken.map(({ below: _, ...file }) => file).sort((a, b) => (a.path < b.path ? -1 : 1)),
    leftOut: [...rest.map(({ below }) => below), ...live.map(({ path }) => path)].sort(),
    notPictures: files
      .filter((_, i) => !asNamed[i])
      .map(({ path }) => path)
      .sort(),
    unreadableNames: ours
      .filter((file) => !named.includes(file))
      .map(({ path }) => path)
      .sort(),
    picturesElsewhere: hasPictures(files) ? undefined : folderOfPictures(rest),
  };
}
