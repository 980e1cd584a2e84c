// The summary of a dataset: how many files of each kind it has, in words.
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';

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

export interface CountedFile {
  readonly kind: FileKind;
  /** True for a MASK whose pixels of value 0 are ignored. */
  readonly ignores?: boolean;
}

/** Returns a summary such as "15 photographs, 3 files of poses". */
export function describe(files: readonly CountedFile[]): string {
  const kinds = files.map(({ kind, ignores }) => (ignores ? FileKind.IGNORE_MASK : kind));
  return words
    .map(([kind, one, many]) => {
      const count = kinds.filter((other) => other === kind).length;
      return count === 0 ? '' : `${count} ${count === 1 ? one : many}`;
    })
    .filter(Boolean)
    .join(', ');
}
