// The photographs' cameras in the 3D view: the one under the pointer shows its photograph, and a click goes there.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { SplatViewer } from '../viewer/splat_viewer';

interface Under {
  readonly view: View;
  /** Position of the pointer, as shares of width and height. */
  readonly x: number;
  readonly y: number;
}

export interface Cameras {
  readonly areShown: boolean;
  onShow(areShown: boolean): void;
  onView(view: View): void;
  photoOf(view: View): string;
}

export function useCameras(
  { areShown }: Cameras,
  views: readonly View[],
  viewer: { readonly current: SplatViewer | undefined },
  made: number,
) {
  const [under, setUnder] = useState<Under>();
  useEffect(() => {
    setUnder(undefined);
    viewer.current?.showCameras(areShown);
  }, [made, areShown]);
  useEffect(() => viewer.current?.emphasise(under?.view.view ?? ''), [made, under]);
  return {
    under,
    /** `isFree`: whether nothing is dragged. */
    move: (event: PointerEvent, isFree: boolean) => {
      if (!areShown) return;
      const canvas = event.currentTarget as Element;
      const { left, top, width, height } = canvas.getBoundingClientRect();
      const at = { x: (event.clientX - left) / width, y: (event.clientY - top) / height };
      const name = isFree && event.buttons === 0 ? viewer.current?.viewAt(at.x, at.y) : undefined;
      const view = views.find((other) => other.view === name);
      canvas.classList.toggle('on-camera', view !== undefined);
      setUnder(view && { view, ...at });
    },
    leave: () => setUnder(undefined),
  };
}

/** The name and the photograph of the camera under the pointer. */
export function CameraNote({ under, photo }: { under: Under; photo: string }): JSX.Element {
  const { view, x, y } = under;
  const side = x > 0.5 ? { right: `${100 * (1 - x)}%` } : { left: `${100 * x}%` };
  const end = y > 0.5 ? { bottom: `${100 * (1 - y)}%` } : { top: `${100 * y}%` };
  return (
    <div class="camera-note" style={{ ...side, ...end }}>
      <img src={photo} alt="" />
      <span>{view.view}</span>
    </div>
  );
}
