// Advice on photographs before they are uploaded: as far as the browser can say it in a moment.
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
import type { DatasetFile } from './dataset_files';
import { leastForPoses } from './dataset_verdict';
import { namesText } from './names_text';
import { pixelSizeOf } from './pixel_size';

/** Fewer photographs than these give a poor scene. */
const fewPhotographs = 10;
/** Longer side under which a photograph shows little, pixels. */
const smallSide = 640;
/** Bytes of all files above which an upload takes long. */
const manyBytes = 2e9;

/** Returns a digest of a file. */
export type Digest = (file: Blob) => Promise<string>;

/** Returns the groups of files that share a key; files without one are in none. */
function groupsBy<T>(files: readonly T[], keys: readonly (string | undefined)[]): T[][] {
  const groups = new Map<string, T[]>();
  files.forEach((file, i) => {
    const key = keys[i];
    if (key !== undefined) groups.set(key, [...(groups.get(key) ?? []), file]);
  });
  return [...groups.values()].filter((group) => group.length > 1);
}

/** Returns groups of equal photographs. Only those of equal size are read. */
async function equalOnes(
  photographs: readonly DatasetFile[],
  digest: Digest,
): Promise<DatasetFile[][]> {
  const sizes = photographs.map(({ file }) => String(file.size));
  const alike = groupsBy(photographs, sizes).flat();
  const digests: string[] = [];
  for (const { file } of alike) digests.push(await digest(file));
  return groupsBy(alike, digests);
}

/** Fewer than `leastForPoses` are a fault, which the verdict names. */
function fewText(count: number, hasVideo: boolean): string {
  if (hasVideo || count >= fewPhotographs || count < leastForPoses) return '';
  return `Only ${count} photographs: twenty or more, from all around, give a better scene.`;
}

function equalText(groups: readonly DatasetFile[][]): string {
  const spare = groups.flatMap(([, ...others]) => others.map(({ path }) => path));
  if (spare.length === 0) return '';
  return `Copies of other photographs, which add nothing: ${namesText(spare)}.`;
}

function smallText(small: readonly DatasetFile[]): string {
  if (small.length === 0) return '';
  const paths = namesText(small.map(({ path }) => path));
  return `Smaller than ${smallSide} pixels; the originals would show more: ${paths}.`;
}

/** Returns advice on the files of a dataset, one sentence each; none prevents the upload. */
export async function adviceOn(files: readonly DatasetFile[], digest: Digest): Promise<string[]> {
  const photographs = files.filter(({ kind }) => kind === FileKind.IMAGE);
  const hasVideo = files.some(({ kind }) => kind === FileKind.VIDEO);
  const sizes = await Promise.all(photographs.map(({ file }) => pixelSizeOf(file)));
  const small = photographs.filter((_, i) => {
    const size = sizes[i];
    return size !== undefined && Math.max(size.width, size.height) < smallSide;
  });
  const bytes = files.reduce((sum, { file }) => sum + file.size, 0);
  return [
    fewText(photographs.length, hasVideo),
    equalText(await equalOnes(photographs, digest)),
    smallText(small),
    bytes > manyBytes ? 'This is much to upload: it may take long. Keep the page open.' : '',
  ].filter(Boolean);
}
