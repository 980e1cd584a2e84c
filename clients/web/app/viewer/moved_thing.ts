// Gaussians that are moved in the 3D view before the move is made: they are drawn a second time, with handles.
import { Euler, Group, MathUtils } from 'three';
import type { PerspectiveCamera } from 'three';
import { TransformControls } from 'three/examples/jsm/controls/TransformControls.js';
import type { MoveMode } from '../edit/drafting';
import type { Move } from '../edit/move';
import type { Triple } from '../gaussians/crop_box';
import { MarkedSplats } from './marked_splats';

export interface MovedHost {
  /** Called when the picture changes. */
  changed(): void;
  /** Called when a drag of a handle begins and ends. */
  dragged(isDragged: boolean): void;
}

/** Size of the handles, in three's units, on a canvas of this height or more, pixels; on smaller ones it grows. */
const handleSize = 0.8;
const largeHeight = 600;
const maxHandleSize = 1.6;

/** Its origin is the pivot, and its transform the move. */
export class MovedThing extends Group {
  private readonly thing = new Group();
  private splats: MarkedSplats | undefined;
  private handles: TransformControls | undefined;
  private onMove: (move: Move) => void = () => undefined;
  private pivot: Triple = [0, 0, 0];

  constructor(
    private readonly camera3d: PerspectiveCamera,
    private readonly canvas: HTMLCanvasElement,
    private readonly host: MovedHost,
  ) {
    super();
    this.thing.rotation.order = 'XYZ';
    this.add(this.thing);
  }

  /** Shows the Gaussians of a PLY with handles. `onMove`: called when somebody drags these. */
  async begin(file: Blob, pivot: Triple, onMove: (move: Move) => void): Promise<void> {
    this.stop();
    this.pivot = pivot;
    this.onMove = onMove;
    this.thing.position.set(...pivot);
    const handles = this.makeHandles();
    const splats = await MarkedSplats.of(await file.arrayBuffer(), undefined);
    // Another move may have begun meanwhile, or this one ended.
    if (this.handles !== handles) return splats.dispose();
    this.splats = splats;
    splats.mesh.position.set(...pivot).negate();
    this.thing.add(splats.mesh);
    this.host.changed();
  }

  setMode(mode: MoveMode): void {
    this.handles?.setMode(mode);
  }

  /** Puts the Gaussians where a move leads. */
  put({ translation, rotation, scale }: Move): void {
    const [x, y, z] = rotation.map((angle) => MathUtils.degToRad(angle)) as [number, number, number];
    this.thing.position.set(...this.pivot).add({ x: translation[0], y: translation[1], z: translation[2] });
    this.thing.rotation.set(x, y, z);
    this.thing.scale.setScalar(scale);
    this.host.changed();
  }

  /** Ends the move; everything is where it was. */
  stop(): void {
    const { handles, splats } = this;
    this.handles = undefined;
    this.splats = undefined;
    if (handles) {
      this.remove(handles.getHelper());
      handles.detach();
      handles.dispose();
      // They give the page its scrolling back, but a drag here turns the view.
      this.canvas.style.touchAction = 'none';
      this.hovered(false);
    }
    if (splats) {
      this.thing.remove(splats.mesh);
      splats.dispose();
    }
    this.thing.rotation.set(0, 0, 0);
    this.thing.scale.setScalar(1);
    this.host.dragged(false);
    this.host.changed();
  }

  private makeHandles(): TransformControls {
    const handles = new TransformControls(this.camera3d, this.canvas);
    const height = Math.max(1, this.canvas.clientHeight);
    handles.setSize(Math.min(handleSize * Math.max(1, largeHeight / height), maxHandleSize));
    handles.attach(this.thing);
    handles.addEventListener('change', () => this.host.changed());
    handles.addEventListener('dragging-changed', ({ value }) => this.host.dragged(value === true));
    handles.addEventListener('axis-changed', ({ value }) => this.hovered(value !== null));
    handles.addEventListener('objectChange', () => this.dragged(handles));
    this.add(handles.getHelper());
    this.handles = handles;
    return handles;
  }

  private hovered(isOverHandle: boolean): void {
    this.canvas.classList.toggle('on-handle', isOverHandle);
  }

  private dragged(handles: TransformControls): void {
    const { position, quaternion, scale } = this.thing;
    // A handle of one axis or two scales all of them: a move has one scale.
    const axis = handles.axis ?? 'X';
    const factor = axis.includes('X') ? scale.x : axis.includes('Y') ? scale.y : scale.z;
    scale.setScalar(Math.abs(factor));
    const turned = new Euler().setFromQuaternion(quaternion, 'XYZ');
    const [px, py, pz] = this.pivot;
    const degrees = (angle: number) => MathUtils.radToDeg(angle);
    this.onMove({
      translation: [position.x - px, position.y - py, position.z - pz],
      rotation: [degrees(turned.x), degrees(turned.y), degrees(turned.z)],
      scale: scale.x,
    });
  }
}
