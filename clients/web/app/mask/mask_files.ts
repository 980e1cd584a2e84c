// Masks as files of a ZIP: a folder a label, by the label's id, and labels.json, which says what
// each id is called. What people call things is text, never a path.
import type { ViewMasks } from './coco';
import type { Rle } from './rle';

export interface MaskFile {
  readonly path: string;
  readonly rle: Rle;
}

/** Of a view: its name without the suffix, as the dataset has it ("cam0/0001"). */
function stemOf(view: string): string {
  return view.replace(/\.\w+$/, '');
}

/**
 * Where each mask goes. Views that differ in their suffix only keep it, so that no file takes the
 * place of another.
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

/** labels.json: from the folder's name to what the label is called. */
export function labelsJson(segments: readonly ViewMasks[]): string {
  return JSON.stringify(
    Object.fromEntries(segments.map(({ id, category }) => [id, category])),
    undefined,
    1,
  );
}
