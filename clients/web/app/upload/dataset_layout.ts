// The layout of a dataset's folder: what a file is by its path. The rule is the same in all clients
// (clients/cpp/dataset_folder.cc, clients/python/pepeseg/pepeseg/dataset.py).
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';

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

const layoutFolder = /^(images|videos|masks|ignore|depth|disparity|sparse)$/i;

const systemFile =
  /^(\.|(thumbs\.db|desktop\.ini|__macosx|@eadir|#recycle|\$recycle\.bin|lost\+found)$)/i;

/** Number of folders inside the dropped one that are searched for the scene. */
const deepestScene = 4;

export function isPhotograph(path: string): boolean {
  return photograph.test(path);
}

export function isVideo(path: string): boolean {
  return video.test(path);
}

/** Returns the kind of a file by its path below the scene's folder; undefined for other files. */
export function kindOf(path: string): FileKind | undefined {
  return exact[path] ?? folders.find(([folder, name]) => folder.test(path) && name.test(path))?.[2];
}

/** Returns the path with the layout's folder in lower case: "Images/7.jpg" is "images/7.jpg". */
export function inLayout(path: string): string {
  const slash = path.indexOf('/');
  const folder = path.slice(0, Math.max(slash, 0));
  return layoutFolder.test(folder) ? folder.toLowerCase() + path.slice(slash) : path;
}

/** Returns whether a system or program leaves such a file next to photographs. */
export function isSystemFile(path: string): boolean {
  return path.split('/').some((part) => systemFile.test(part));
}

/**
 * Returns whether the contract's messages can hold the path. Browsers put U+FFFD, half a surrogate
 * pair or nothing where a name is not UTF-8.
 */
export function isReadableName(path: string): boolean {
  const halfPair = /[\ud800-\udfff]/u;
  return !/\ufffd/.test(path) && !halfPair.test(path) && !path.split('/').includes('');
}

/**
 * Returns the scene's folder with a slash, or "": the dropped folder, or that inside it if there is
 * nothing else, as archives unpack to.
 */
export function sceneFolder(paths: readonly string[]): string {
  const first = paths[0]?.split('/').slice(0, -1) ?? [];
  let shared = '';
  for (const part of first.slice(0, 1 + deepestScene)) {
    const next = `${shared}${part}/`;
    if (layoutFolder.test(part) || !paths.every((path) => path.startsWith(next))) break;
    shared = next;
  }
  return shared;
}
