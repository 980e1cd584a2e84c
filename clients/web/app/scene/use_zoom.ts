// Zoom and pan of the shown photograph: by wheel, by dragging with the middle button or with Space held,
// by two fingers, and by keys.
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';
import type { Spot } from './marks';
import type { Edges, Size, Zoom } from './photo_frame';
import { edgesOf, fitted, panned, revealed, spotAt, wheelFactor, zoomedAt } from './photo_frame';

/** Factor of a key or a button. */
const keyFactor = 1.5;

const noStage: Edges = { left: 0, top: 0, width: 0, height: 0 };

function positionOf({ clientX, clientY }: MouseEvent): Spot {
  return { x: clientX, y: clientY };
}

/** The pointer's stay over the stage. */
interface Stay {
  /** The button that had the focus by a click when the stay began: Space is not meant for it. */
  readonly clicked: Element | undefined;
}

function stayNow(): Stay {
  const focused = document.activeElement;
  return { clicked: focused && !focused.matches(':focus-visible') ? focused : undefined };
}

/** Returns whether Space is held during a stay, and not meant for what has the focus. */
function useHeldSpace(stay: { readonly current: Stay | undefined }): boolean {
  const [held, setHeld] = useState(false);
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      if (event.key !== ' ' || !stay.current || target.closest('input, select, dialog')) return;
      if (target.closest('button, summary, a') && target !== stay.current.clicked) return;
      event.preventDefault();
      setHeld(true);
    };
    const release = (event: KeyboardEvent) => {
      if (event.key !== ' ') return;
      // Firefox presses a button when Space is released.
      if (event.target === stay.current?.clicked) event.preventDefault();
      setHeld(false);
    };
    const leave = () => setHeld(false);
    window.addEventListener('keydown', press);
    window.addEventListener('keyup', release);
    window.addEventListener('blur', leave);
    return () => {
      window.removeEventListener('keydown', press);
      window.removeEventListener('keyup', release);
      window.removeEventListener('blur', leave);
    };
  }, [stay]);
  return held;
}

/**
 * Holds the zoom of a photograph, which another one (`view`) resets. `onGesture` is called when a gesture
 * takes the pointer from what was begun with it.
 */
export function useZoom(photo: Size, view: string, onGesture: () => void) {
  const stage = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<Size>({ width: 0, height: 0 });
  const [zoom, setZoom] = useState<Zoom>(fitted);
  const stay = useRef<Stay | undefined>(undefined);
  const canPan = useHeldSpace(stay);
  /** Positions of the pointers of a gesture, and of a finger that a second one may join. */
  const pointers = useRef(new Map<number, Spot>());
  const [gesture, setGesture] = useState<'none' | 'pan' | 'pinch'>('none');

  useLayoutEffect(() => setZoom(fitted), [view]);
  useLayoutEffect(() => {
    const element = stage.current;
    if (!element) return undefined;
    const measure = () => setSize({ width: element.clientWidth, height: element.clientHeight });
    measure();
    const sizes = new ResizeObserver(measure);
    sizes.observe(element);
    // Two fingers are a pinch, not a scroll of the page.
    const hold = (event: TouchEvent) => {
      if (event.touches.length > 1 && event.cancelable) event.preventDefault();
    };
    element.addEventListener('touchstart', hold, { passive: false });
    element.addEventListener('touchmove', hold, { passive: false });
    return () => {
      sizes.disconnect();
      element.removeEventListener('touchstart', hold);
      element.removeEventListener('touchmove', hold);
    };
  }, []);

  const edges = (): Edges => stage.current?.getBoundingClientRect() ?? noStage;
  /** Changes the zoom; a hidden stage keeps it. */
  const change = (next: (now: Zoom, stage: Edges) => Zoom) => {
    const there = edges();
    if (there.width > 0 && there.height > 0) setZoom((now) => next(now, there));
  };
  const zoomBy = (factor: number, at: Spot) =>
    change((now, there) => zoomedAt(there, photo, now, factor, at));

  const press = (event: PointerEvent) => {
    const isTouch = event.pointerType === 'touch';
    const isPan = !isTouch && (event.button === 1 || (event.button === 0 && canPan));
    if (!isTouch && !isPan) return;
    pointers.current.set(event.pointerId, positionOf(event));
    const isPinch = isTouch && pointers.current.size === 2;
    if (isPinch || isPan) {
      setGesture(isPinch ? 'pinch' : 'pan');
      onGesture();
    }
    if (!isPinch && !isPan && gesture === 'none') return;
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    event.preventDefault();
    event.stopPropagation();
  };
  const move = (event: PointerEvent) => {
    const from = pointers.current.get(event.pointerId);
    if (!from) return;
    const to = positionOf(event);
    pointers.current.set(event.pointerId, to);
    if (gesture === 'none') return;
    event.stopPropagation();
    const other = [...pointers.current].find(([id]) => id !== event.pointerId)?.[1];
    const by = { x: to.x - from.x, y: to.y - from.y };
    if (gesture === 'pan') return change((now, there) => panned(there, photo, now, by));
    if (!other) return undefined;
    // Each finger moves the middle between them by half of its own way.
    const half = { x: by.x / 2, y: by.y / 2 };
    const middle = { x: (to.x + other.x) / 2, y: (to.y + other.y) / 2 };
    const apart = (a: Spot) => Math.max(1, Math.hypot(a.x - other.x, a.y - other.y));
    const factor = apart(to) / apart(from);
    return change((now, there) =>
      zoomedAt(there, photo, panned(there, photo, now, half), factor, middle),
    );
  };
  const release = (event: PointerEvent) => {
    pointers.current.delete(event.pointerId);
    if (gesture === 'none') return;
    event.stopPropagation();
    if (pointers.current.size === 0) setGesture('none');
  };
  const wheel = (event: WheelEvent) => {
    event.preventDefault();
    zoomBy(wheelFactor(event), positionOf(event));
  };

  const placed = edgesOf({ ...noStage, ...size }, photo, zoom);
  const middle = (): Spot => {
    const { left, top, width, height } = edges();
    return { x: left + width / 2, y: top + height / 2 };
  };
  return {
    stage,
    zoom,
    /** Edges of the photograph from the stage's corner. */
    placed,
    isPanning: canPan || gesture === 'pan',
    spotOf: (event: PointerEvent): Spot =>
      spotAt(edgesOf(edges(), photo, zoom), photo, positionOf(event)),
    /** Zooms by a key, `steps` steps, around a spot of the photograph or the stage's middle. */
    step(steps: number, around?: Spot): void {
      const { left, top, width, height } = edgesOf(edges(), photo, zoom);
      zoomBy(keyFactor ** steps, {
        ...middle(),
        ...(around && {
          x: left + (around.x / photo.width) * width,
          y: top + (around.y / photo.height) * height,
        }),
      });
    },
    fit: () => setZoom(fitted),
    reveal: (spot: Spot) => change((now, there) => revealed(there, photo, now, spot)),
    handlers: {
      onPointerDownCapture: press,
      onPointerMoveCapture: move,
      onPointerUpCapture: release,
      onPointerCancelCapture: release,
      onPointerEnter: () => {
        stay.current = stayNow();
      },
      onPointerLeave: () => {
        stay.current = undefined;
      },
      onWheel: wheel,
    },
  };
}
