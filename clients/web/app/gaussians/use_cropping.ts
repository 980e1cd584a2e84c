// Dragging the handles of the crop box in the 3D view.
import { useEffect, useRef } from 'preact/hooks';
import type { SplatViewer } from '../viewer/splat_viewer';
import type { CropBox, Face } from './crop_box';
import { withFace } from './crop_box';

interface Dragged {
  readonly face: Face;
  /** Position of the newest event, as shares of width and height. */
  readonly x: number;
  readonly y: number;
}

function shareOf(event: PointerEvent): { x: number; y: number } {
  const { left, top, width, height } = (event.currentTarget as Element).getBoundingClientRect();
  return { x: (event.clientX - left) / width, y: (event.clientY - top) / height };
}

export interface Cropping {
  /** Called at most once in a picture of the screen. */
  onCrop(crop: CropBox): void;
  /** Called when a handle is released. */
  onRest(): void;
}

/** Handlers return whether the event is theirs. */
export function useCropping(
  crop: CropBox | undefined,
  viewer: { readonly current: SplatViewer | undefined },
  turns: boolean,
  { onCrop, onRest }: Cropping,
) {
  const dragged = useRef<Dragged | undefined>(undefined);
  const frame = useRef(0);
  const newest = useRef({ crop, onCrop });
  newest.current = { crop, onCrop };
  const follow = () => {
    cancelAnimationFrame(frame.current);
    frame.current = 0;
    const { crop: box, onCrop: take } = newest.current;
    if (!dragged.current || !box || !viewer.current) return;
    const { face, x, y } = dragged.current;
    const to = viewer.current.crop.draggedTo(face, viewer.current.rayAt(x, y));
    take(withFace(box, face, to));
  };
  useEffect(() => () => cancelAnimationFrame(frame.current), []);
  return {
    press: (event: PointerEvent): boolean => {
      if (event.button !== 0 || !crop || !viewer.current) return false;
      const { x, y } = shareOf(event);
      const face = viewer.current.crop.faceAt(viewer.current.rayAt(x, y));
      if (!face) return false;
      dragged.current = { face, x, y };
      viewer.current.letTurn(false);
      return true;
    },
    move: (event: PointerEvent): boolean => {
      const { x, y } = shareOf(event);
      if (dragged.current) {
        dragged.current = { ...dragged.current, x, y };
        frame.current ||= requestAnimationFrame(follow);
        return true;
      }
      const isOver = !!crop && !!viewer.current?.crop.faceAt(viewer.current.rayAt(x, y));
      (event.currentTarget as Element).classList.toggle('on-handle', isOver);
      return false;
    },
    release: (): boolean => {
      if (!dragged.current) return false;
      follow();
      dragged.current = undefined;
      onRest();
      viewer.current?.letTurn(turns);
      return true;
    },
  };
}
