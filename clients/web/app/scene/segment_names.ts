// Names of segments: those of the things that people named and whose masks the segments have.
import { useMemo } from 'preact/hooks';
import type { GreyPicture } from '../mask/grey_png';
import type { Rle } from '../mask/rle';
import { decodeRle } from '../mask/rle';
import { useStore } from '../store';
import type { SceneEverything } from './everything';
import type { SceneLabels } from './labels';
import { labelName } from './labels';
import { seenSegments } from './segments';
import type { ThingMasks } from './thing_masks';

/** Names of segments in the shown view at the shown level, by their ids. */
export type SegmentNames = ReadonlyMap<number, string>;

/** A segment has the name of a thing whose mask overlaps more than this with it (IoU). */
const minIou = 0.5;

/** Returns the id of the segment that has the mask; undefined if none overlaps enough. */
export function segmentWith(picture: GreyPicture, mask: Rle): number | undefined {
  const pixels = decodeRle(mask);
  const both = new Map<number, number>();
  let area = 0;
  for (let y = 0, i = 0; y < picture.height; ++y) {
    const row = Math.floor(((y + 0.5) * mask.height) / picture.height) * mask.width;
    for (let x = 0; x < picture.width; ++x, ++i) {
      if (!pixels[row + Math.floor(((x + 0.5) * mask.width) / picture.width)]) continue;
      const id = picture.values[i] as number;
      ++area;
      both.set(id, (both.get(id) ?? 0) + 1);
    }
  }
  return seenSegments(picture).find(({ id, area: own }) => {
    const shared = both.get(id) ?? 0;
    return shared > minIou * (own + area - shared);
  })?.id;
}

export function useSegmentNames(
  everything: SceneEverything,
  things: ThingMasks,
  labels: SceneLabels,
): SegmentNames {
  const { seen } = useStore(everything.state);
  const { masks } = useStore(things.state);
  const list = useStore(labels.list);
  return useMemo(() => {
    const names = new Map<number, string>();
    if (!seen) return names;
    for (const label of list) {
      const mask = masks.get(label.name);
      const id = mask && mask.area > 0 ? segmentWith(seen.picture, mask.rle) : undefined;
      if (id !== undefined && !names.has(id)) names.set(id, labelName(label));
    }
    return names;
  }, [seen, masks, list]);
}
