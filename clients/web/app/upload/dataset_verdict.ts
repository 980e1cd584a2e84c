// Whether dropped files make a scene, and what a person should know about them before the upload.
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
import type { Dataset } from './dataset_files';
import { namesText } from './names_text';

export interface Verdict {
  /** good: nothing is wrong. bad: there is something to do first. */
  readonly tone: 'good' | 'bad';
  readonly canUpload: boolean;
  readonly canTrain: boolean;
  /** What is wrong, one sentence each. */
  readonly faults: readonly string[];
}

/** Least number of photographs from which the server estimates poses. */
export const leastForPoses = 3;
/** Least number of photographs that show depth. */
const leastForDepth = 2;
function notPicturesText(paths: readonly string[]): string {
  if (paths.length === 0) return '';
  return `Left out, because the content is not a photograph or a video: ${namesText(paths)}.`;
}

function unreadableNamesText(paths: readonly string[]): string {
  if (paths.length === 0) return '';
  return `Left out, because the name is not UTF-8; rename the file: ${namesText(paths)}.`;
}

function nonePresentText(elsewhere: string | undefined): string {
  if (elsewhere === undefined) return 'There are no photographs and no videos among these files.';
  return `There are no photographs and no videos in the folder itself, its images/ or its videos/. There are some in ${elsewhere}/: drop that folder, or rename it to images.`;
}

function tooFewText(numPhotographs: number, hasPoses: boolean): string {
  const least = hasPoses ? leastForDepth : leastForPoses;
  const number = numPhotographs === 1 ? 'One photograph is' : `${numPhotographs} photographs are`;
  return `${number} too few for a scene: add others of the same things from all around, at least ${least}, better twenty or more.`;
}

export function verdictOf(dataset: Dataset): Verdict {
  const { files, notPictures, unreadableNames, picturesElsewhere } = dataset;
  const count = (kind: FileKind) => files.filter((file) => file.kind === kind).length;
  const numPhotographs = count(FileKind.IMAGE);
  const hasVideo = count(FileKind.VIDEO) > 0;
  const hasPoses = count(FileKind.POSES) > 0;
  const canUpload = hasVideo || numPhotographs > 0;
  const enough = hasVideo || numPhotographs >= (hasPoses ? leastForDepth : leastForPoses);
  const faults = [
    canUpload ? '' : nonePresentText(picturesElsewhere),
    enough || !canUpload ? '' : tooFewText(numPhotographs, hasPoses),
    notPicturesText(notPictures),
    unreadableNamesText(unreadableNames),
  ].filter(Boolean);
  return {
    tone: faults.length === 0 ? 'good' : 'bad',
    canUpload,
    canTrain: enough,
    faults,
  };
}
