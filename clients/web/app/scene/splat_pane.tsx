// The 3D view of a scene: dragging turns it, a click segments, a double click sets what it turns about.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { Icon } from '../components/icons';
import { MissNote } from '../components/miss_note';
import { OutlineMark, PickBar } from '../gaussians/pick_bar';
import type { Picking } from '../gaussians/use_picking';
import { useCropping } from '../gaussians/use_cropping';
import { usePicking } from '../gaussians/use_picking';
import { paintMask } from '../mask/paint';
import { useStore } from '../store';
import type { Mask } from './answer';
import type { Miss } from './miss';
import type { FreeCamera, Point, Prompt } from './prompt';
import { useShortcuts } from './shortcuts';
import type { Cameras } from './use_cameras';
import { CameraNote, useCameras } from './use_cameras';
import type { Tool } from './use_drawing';
import type { Viewed } from './use_viewer';
import { useViewer } from './use_viewer';

interface Props extends Viewed {
  mask: Mask | undefined;
  prompt: Prompt | undefined;
  /** Position of a click that hit nothing, here or in a view. */
  miss: Miss | undefined;
  tool: Tool;
  onPicking: (picking: Picking) => void;
  cameras: Cameras;
  onPoint: (camera: FreeCamera, point: Point) => void;
  /** Makes the move that is drafted. */
  onApply: () => void;
  /** Takes back the prompt of the last click, which was the first one of a double click. */
  onTakeBack: () => void;
}

/** Maximum time between the clicks of a double click, milliseconds. */
const doubleTime = 350;
/** Maximum distance between the clicks of a double click, pixels of the screen. */
const doubleSlack = 6;

const turns: Record<string, readonly [number, number, number]> = {
  ArrowLeft: [-0.1, 0, 1],
  ArrowRight: [0.1, 0, 1],
  ArrowUp: [0, -0.1, 1],
  ArrowDown: [0, 0.1, 1],
  '+': [0, 0, 0.9],
  '-': [0, 0, 1.1],
};

const turnLabel =
  '3D view. Arrow keys turn it, plus and minus come closer and go away, Enter segments what is in its middle.';
const pickLabel =
  '3D view. Arrow keys turn it, plus and minus come closer and go away, Enter picks the Gaussians in its middle; with Shift it adds them, with Alt it takes them away.';
const moveLabel =
  '3D view. Arrow keys turn it, plus and minus come closer and go away, Enter makes the move. The numbers of the move are in the side panel.';

export function SplatPane(props: Props): JSX.Element {
  const { view, views, mask, prompt, miss, tool, edits, drafting, picking, onPicking } = props;
  const { onPoint, onTakeBack } = props;
  const overlay = useRef<HTMLCanvasElement>(null);
  const asked = useRef<FreeCamera | undefined>(undefined);
  const pressed = useRef<{ x: number; y: number } | undefined>(undefined);
  const clicked = useRef<{ x: number; y: number; time: number } | undefined>(undefined);
  const [stale, setStale] = useState(false);
  const { canvas, viewer, status, shown, made: numMade } = useViewer(props, () => {
    asked.current = undefined;
    setStale(true);
  });
  const cameras = useCameras(props.cameras, views, viewer, numMade);
  const drawn = usePicking(picking, edits, viewer);
  const { numPicked, numHidden, edits: edited } = useStore(edits.state);
  const cropping = useCropping(edited.crop, viewer, picking.drag === 'turn', {
    onCrop: (crop) => edits.cropTo(crop),
    onRest: () => edits.restCrop(),
  });
  const points = prompt?.kind === 'points' && 'camera' in prompt.place ? prompt.points : [];
  const camera =
    prompt && 'place' in prompt && 'camera' in prompt.place ? prompt.place.camera : undefined;
  // A mask belongs to the camera for which it was made. After a move and a click it is not drawn
  // until the new answer comes, and never if that click hits nothing.
  const made = useRef({ mask, camera });
  if (made.current.mask !== mask) made.current = { mask, camera };
  const isShown = (at: FreeCamera | undefined) =>
    !stale && at !== undefined && at === asked.current;
  const shownMask = isShown(made.current.camera) ? mask : undefined;
  useEffect(() => {
    if (overlay.current) paintMask(overlay.current, shownMask?.rle);
  }, [shownMask]);

  /** Segments at a position, given as shares of width and height. */
  const ask = (x: number, y: number, negative: boolean) => {
    if (!viewer.current) return;
    // While the picture stands still the camera is the same, so that points join one prompt.
    const at = (asked.current ??= viewer.current.shownCamera());
    setStale(false);
    onPoint(at, { x: x * at.width, y: y * at.height, negative: negative || tool === 'exclude' });
  };
  /** While something is moved, a drag is for its handles, or turns the view. */
  const isMoving = useStore(drafting.state)?.kind === 'move';
  const picks = drawn.draws && !isMoving;
  const press = (event: PointerEvent) => {
    if (isMoving || cropping.press(event)) return;
    const { button, clientX: x, clientY: y } = event;
    pressed.current = button === 0 ? { x, y } : undefined;
    drawn.press(event);
  };
  const release = (event: PointerEvent) => {
    if (cropping.release()) return;
    if (drawn.draws) return drawn.release();
    const from = pressed.current;
    pressed.current = undefined;
    if (!from || Math.hypot(event.clientX - from.x, event.clientY - from.y) > 4) return;
    const edges = (event.currentTarget as Element).getBoundingClientRect();
    const [x, y] = [(from.x - edges.left) / edges.width, (from.y - edges.top) / edges.height];
    const first = clicked.current;
    const isDouble =
      first !== undefined &&
      event.timeStamp - first.time < doubleTime &&
      Math.hypot(from.x - first.x, from.y - first.y) < doubleSlack;
    clicked.current = isDouble ? undefined : { ...from, time: event.timeStamp };
    if (cameras.under) return props.cameras.onView(cameras.under.view);
    if (!isDouble) return ask(x, y, event.shiftKey);
    onTakeBack();
    viewer.current?.pivotAt(x, y);
  };
  const home = () => viewer.current?.home();
  const backToView = () => viewer.current?.goTo(view);
  useShortcuts({ h: home, b: backToView });
  const key = (event: KeyboardEvent) => {
    const turn = turns[event.key];
    if (turn) viewer.current?.turn(...turn);
    else if (event.key === 'Enter' && isMoving) props.onApply();
    else if (event.key === 'Enter' && drawn.draws) drawn.pickMiddle(event);
    else if (event.key === 'Enter') ask(0.5, 0.5, event.shiftKey);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div
      class="splats"
      data-status={typeof status === 'string' ? status : 'error'}
      data-shown={shown}
      data-picked={numPicked}
      data-hidden={numHidden}
      data-crop={edited.crop && [...edited.crop.min, ...edited.crop.max].join(' ')}
      data-things={status === 'ready' ? (props.things?.parts.length ?? 0) : undefined}
    >
      <canvas
        ref={canvas}
        class={`splats-canvas ${picks ? 'picking' : ''}`}
        tabIndex={0}
        role="application"
        aria-label={isMoving ? moveLabel : picks ? pickLabel : turnLabel}
        onPointerDown={press}
        onPointerMove={(event) => {
          const isDragged = !isMoving && cropping.move(event);
          if (!isDragged) drawn.move(event);
          cameras.move(event, !isDragged && !drawn.draws && !isMoving);
        }}
        onPointerLeave={cameras.leave}
        onPointerCancel={() => cropping.release() || drawn.drop()}
        onPointerUp={release}
        onKeyDown={key}
      />
      <canvas ref={overlay} class="overlay" aria-hidden="true" data-area={shownMask?.area ?? 0} />
      {camera && isShown(camera) && (
        <svg class="overlay" viewBox={`0 0 ${camera.width} ${camera.height}`} aria-hidden="true">
          {points.map(({ x, y, negative }) => (
            <circle
              key={`${x},${y}`}
              class={negative ? 'mark negative' : 'mark'}
              cx={x}
              cy={y}
              r="7"
            />
          ))}
        </svg>
      )}
      {miss && 'camera' in miss.place && isShown(miss.place.camera) && (
        <MissNote x={miss.x / miss.place.camera.width} y={miss.y / miss.place.camera.height} />
      )}
      {drawn.outline.length > 1 && <OutlineMark outline={drawn.outline} />}
      {cameras.under && (
        <CameraNote under={cameras.under} photo={props.cameras.photoOf(cameras.under.view)} />
      )}
      <PickBar edits={edits} picking={picking} onPicking={onPicking} />
      <div class="pane-buttons right">
        <button
          type="button"
          title="The photographs’ cameras, on or off (M)"
          aria-pressed={props.cameras.areShown}
          onClick={() => props.cameras.onShow(!props.cameras.areShown)}
        >
          Cameras
        </button>
        <button type="button" title="All of the scene (H)" onClick={home}>
          <Icon name="home" /> Home
        </button>
        <button type="button" title="Back to the photograph’s camera (B)" onClick={backToView}>
          <Icon name="camera" /> This view
        </button>
      </div>
      {status === 'loading' && (
        <p class="pane-note" role="status">
          Loading the model …
        </p>
      )}
      {typeof status === 'object' && (
        <p class="pane-note" role="alert">
          {status.error}
        </p>
      )}
    </div>
  );
}
