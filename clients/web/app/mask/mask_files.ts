// Masks as files of a ZIP: a folder for each label, named by its id, and labels.json, which has each
// label's text. A text that people typed never becomes a path.
import type { ViewMasks } from './coco';
import type { Rle } from './rle';

export interface MaskFile {
  readonly path: string;
  readonly rle: Rle;
}

/** Name of the view without its suffix, as in the dataset ("cam0/0001"). */
function stemOf(view: string): string {
  return view.replace(/\.\w+$/, '');
}

/**
 * Returns the path of each mask. Views that differ only in their suffix keep it, so that no file
 * replaces another.
 */
export function maskFiles(segments: readonly ViewMasks[]): MaskFile[] {
  return segments.flatMap(({ id, masks }) => {
    const stems = masks.map(({ view }) => stemOf(view));
    return masks.map(({ view, rle }, i) => {
      const stem = stems[i] ?? view;
      const alone = stems.filter((other) => other === stem).length === 1;
      return { path: `${id}/${alone ? stem : view}.png`, rle };
    });
  });
}

/** Returns labels.json: from the folder's name to the label's text. */
export function labelsJson(segments: readonly ViewMasks[]): string {
  return JSON.stringify(
    Object.fromEntries(segments.map(({ id, category }) => [id, category])),
    undefined,
    1,
  );
}
