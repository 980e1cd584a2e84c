// How large the shown photograph is fetched, and its mask drawn.
import { useRef } from 'preact/hooks';
import type { Size } from './photo_frame';

/** Maximum of the longer side, pixels. */
export interface Detail {
  readonly photo: number;
  readonly mask: number;
}

/** More than most screens have. */
const plain: Detail = { photo: 2048, mask: 2048 };
/** For zoomed photographs. The mask's is smaller, because it is painted again for each answer. */
const fine: Detail = { photo: 8192, mask: 4096 };
/** Scale of the zoom from which on the fine detail is used. */
const fineScale = 2;

/** Returns the detail for a view, which stays fine once the view was zoomed. */
export function useDetail(view: string, { width, height }: Size, scale: number): Detail {
  const zoomed = useRef('');
  if (scale >= fineScale) zoomed.current = view;
  const isLarge = Math.max(width, height) > plain.photo;
  return isLarge && zoomed.current === view ? fine : plain;
}
