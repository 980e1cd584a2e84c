// Which dropped files are part of a dataset, and what each is: the layout of the command-line client
// (clients/cli/README.md).
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
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
}

export interface Dataset {
  readonly files: DatasetFile[];
  /** Paths of files that are not part of a dataset. */
  readonly leftOut: string[];
  /** Paths of files that have the name of a photograph or a video, and other content. */
  readonly notPictures: string[];
}

const photograph = /\.(jpe?g|png|webp|heic|heif)$/i;
const video = /\.(mp4|m4v|mov|webm|mkv|avi)$/i;
const depthMap = /\.(png|npy|pfm)$/i;

const exact: Record<string, FileKind> = {
  'transforms.json': FileKind.POSES,
  'poses_bounds.npy': FileKind.POSES,
  'ignore_mask.png': FileKind.IGNORE_MASK,
  'points.ply': FileKind.POINTS,
  'sparse_pc.ply': FileKind.POINTS,
  'gaussians.ply': FileKind.GAUSSIANS,
};

const folders: readonly [folder: RegExp, name: RegExp, kind: FileKind][] = [
  [/^images\//, photograph, FileKind.IMAGE],
  [/^(videos|images)\//, video, FileKind.VIDEO],
  [/^sparse\/(\d+\/)?(cameras|images)\.(bin|txt)$/, /./, FileKind.POSES],
  [/^sparse\/(\d+\/)?points3D\.(bin|txt)$/, /./, FileKind.POINTS],
  [/^masks\//, /\.(json|png|npy)$/i, FileKind.MASK],
  [/^ignore\//, /\.png$/i, FileKind.IGNORE_MASK],
  [/^depth\//, depthMap, FileKind.DEPTH],
  [/^disparity\//, depthMap, FileKind.DISPARITY],
];

export function kindOf(path: string): FileKind | undefined {
  return exact[path] ?? folders.find(([folder, name]) => folder.test(path) && name.test(path))?.[2];
}

/** Returns the folder that contains all files, with a slash, if the scene's folder was dropped. */
export function sharedFolder(paths: readonly string[]): string {
  const first = paths[0]?.split('/').slice(0, -1) ?? [];
  let shared = '';
  for (const part of first) {
    if (!paths.every((path) => path.startsWith(`${shared}${part}/`))) break;
    // "images" and "videos" are part of the layout.
    if (part === 'images' || part === 'videos') break;
    shared += `${part}/`;
  }
  return shared;
}

function hasPictures(files: readonly DatasetFile[]): boolean {
  return files.some(({ kind }) => kind === FileKind.IMAGE || kind === FileKind.VIDEO);
}

/** Takes photographs and videos outside the layout's folders, if those have none. */
function takeLoose(files: DatasetFile[], rest: DroppedFile[]): DroppedFile[] {
  return rest.filter(({ path, file }) => {
    const isVideo = video.test(path);
    if (!isVideo && !photograph.test(path)) return true;
    const folder = isVideo ? 'videos' : 'images';
    const kind = isVideo ? FileKind.VIDEO : FileKind.IMAGE;
    files.push({ path: `${folder}/${path}`, kind, file });
    return false;
  });
}

/** Whether a system or program leaves such a file next to photographs. */
export function isSystemFile(path: string): boolean {
  const known =
    /^(\.|(thumbs\.db|desktop\.ini|__macosx|@eadir|#recycle|\$recycle\.bin|lost\+found)$)/i;
  return path.split('/').some((part) => known.test(part));
}

const stem = (path: string) => path.replace(/\.[^./]*$/, '').toLowerCase();

/** Drops the videos of Live Photos, which have the name of a photograph that was next to them. */
function withoutLivePhotos(files: readonly DatasetFile[]): DatasetFile[] {
  const below = (path: string) => stem(path.replace(/^(images|videos)\//, ''));
  const photographs = new Set(
    files.filter(({ kind }) => kind === FileKind.IMAGE).map(({ path }) => below(path)),
  );
  return files.filter(({ kind, path }) => kind !== FileKind.VIDEO || !photographs.has(below(path)));
}

/** Takes the files that transforms.json names, whatever their folders, from `rest`. */
async function takeReferences(
  files: DatasetFile[],
  rest: readonly DroppedFile[],
): Promise<DroppedFile[]> {
  const transforms = files.find(({ path }) => path === 'transforms.json');
  if (!transforms) return [...rest];
  const named = transformsReferences(await transforms.file.text());
  return rest.filter(({ path, file }) => {
    const kind = named.get(path);
    // The contract has no files without bytes.
    if (kind === undefined || file.size === 0) return true;
    files.push({ path, kind, file });
    return false;
  });
}

async function isAsNamed({ kind, file }: DatasetFile): Promise<boolean> {
  if (kind === FileKind.IMAGE) return beginsAsPhotograph(file);
  return kind !== FileKind.VIDEO || beginsAsVideo(file);
}

export async function readDataset(dropped: readonly DroppedFile[]): Promise<Dataset> {
  const named = dropped.filter(({ path }) => !isSystemFile(path));
  const root = sharedFolder(named.map(({ path }) => path));
  const files: DatasetFile[] = [];
  let rest: DroppedFile[] = [];
  for (const { path, file } of named) {
    const inside = path.slice(root.length);
    // Some tools write no points at all, and the contract has no files without bytes.
    const empty = kindOf(inside) === FileKind.POINTS && file.size === 0;
    const kind = empty ? undefined : kindOf(inside);
    if (kind === undefined) rest.push({ path: inside, file });
    else files.push({ path: inside, kind, file });
  }
  // First, because masks outside the layout's folders would be taken for photographs.
  rest = await takeReferences(files, rest);
  if (!hasPictures(files)) rest = takeLoose(files, rest);
  const asNamed = await Promise.all(files.map(isAsNamed));
  const readable = files.filter((_, i) => asNamed[i]);
  const taken = withoutLivePhotos(readable);
  const live = readable.filter((file) => !taken.includes(file));
  return {
    files: taken.sort((a, b) => (a.path < b.path ? -1 : 1)),
    leftOut: [...rest, ...live].map(({ path }) => path).sort(),
    notPictures: files.filter((_, i) => !asNamed[i]).map(({ path }) => path).sort(),
  };
}

const words: readonly [kind: FileKind, one: string, many: string][] = [
  [FileKind.IMAGE, 'photograph', 'photographs'],
  [FileKind.VIDEO, 'video', 'videos'],
  [FileKind.POSES, 'file of poses', 'files of poses'],
  [FileKind.POINTS, 'file of points', 'files of points'],
  [FileKind.MASK, 'file of masks', 'files of masks'],
  [FileKind.IGNORE_MASK, 'ignore mask', 'ignore masks'],
  [FileKind.DEPTH, 'depth map', 'depth maps'],
  [FileKind.DISPARITY, 'disparity map', 'disparity maps'],
  [FileKind.GAUSSIANS, 'file of Gaussians', 'files of Gaussians'],
];

/** Returns a summary such as "15 photographs, 3 files of poses". */
export function describe(files: readonly { kind: FileKind }[]): string {
  return words
    .map(([kind, one, many]) => {
      const count = files.filter((file) => file.kind === kind).length;
      return count === 0 ? '' : `${count} ${count === 1 ? one : many}`;
    })
    .filter(Boolean)
    .join(', ');
}

/**
 * Makes an id of a scene or a label from a person's text: letters, digits, '_', '.' and '-', beginning
 * with a letter or a digit. A text that is a valid id is not changed.
 */
export function sceneIdFrom(name: string): string {
  const plain = name
    .trim()
    .normalize('NFKD')
    .replace(/[\u0300-\u036f]/g, '')
    .replace(/[^\w.-]+/g, '-')
    .replace(/^[^A-Za-z0-9]+/, '')
    .slice(0, 50)
    .replace(/-+$/, '');
  return plain || 'scene';
}
