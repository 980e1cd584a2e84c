// The 3D view: the exported PLY, drawn by Spark on three.js.
import { SparkRenderer } from '@sparkjsdev/spark';
import type { Ray } from 'three';
import {
  MOUSE,
  Matrix4,
  PerspectiveCamera,
  Raycaster,
  Scene,
  TOUCH,
  Vector2,
  Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { CropBox } from '../gaussians/crop_box';
import type { GaussianSet } from '../gaussians/gaussian_set';
import type { Sight } from '../gaussians/pick';
import type { FreeCamera } from '../scene/prompt';
import type { Lens, Pose } from './camera';
import { fieldOfView, focusOf, freeCameraOf, lensOf, poseOf, upOf } from './camera';
import type { CameraPlace } from './camera_text';
import { CropHandles } from './crop_handles';
import { Frustums } from './frustums';
import type { Marks } from './marked_splats';
import { MarkedSplats, fetchPly, sampledCenters } from './marked_splats';
import { MovedThing } from './moved_thing';
import type { Reach, Sphere } from './reach';
import { keepWithin, reachOf, sphereOf } from './reach';
import type { Tint } from './tint';

export interface SplatPart {
  readonly url: string;
  /** Factors of red, green and blue; absent: the model's colours. */
  readonly tint?: Tint | undefined;
}

/** Maximum height of the pictures that are segmented, pixels; smaller screens use their own. */
const maxPictureHeight = 720;
/** What is seen of the whole scene: about 50 degrees. */
const homeLens: Lens = { across: 0.47, up: 0.47 };
/** Height of the photographs' cameras, in radii of the scene. */
const cameraShare = 0.12;

export class SplatViewer {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(50, 1, 0.01, 1000);
  private readonly spark: SparkRenderer;
  private readonly controls: OrbitControls;
  private readonly sizes: ResizeObserver;
  private parts: MarkedSplats[] = [];
  /** Name of the model that the parts are of. */
  private model = '';
  private marks: Marks | undefined;
  readonly crop = new CropHandles();
  /** What is moved before the move is made. */
  readonly moved: MovedThing;
  private readonly frustums: Frustums;
  /** Whether the camera is that of the newest view, as it was put there. */
  private isAtView = false;
  private loading = new AbortController();
  private drawing = 0;
  private lens: Lens = { across: 0.5, up: 0.5 };
  /** Where the scene is; undefined until a model is loaded. */
  private sphere: Sphere | undefined;
  private reach: Reach | undefined;
  /** From where the views look, which `home` keeps. */
  private readonly viewpoint: Vector3;

  /**
   * Turns about the point that the views look at, upright as they are; begins at the first view.
   * `onMoved` is called when the picture changes. Throws if the browser has no WebGL 2.
   */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    views: readonly View[],
    private readonly onMoved: () => void,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 1.5));
    this.spark = new SparkRenderer({ renderer: this.renderer, onDirty: () => this.draw() });
    this.frustums = new Frustums(views);
    this.moved = new MovedThing(this.camera, canvas, {
      changed: () => this.draw(),
      dragged: (isDragged) => (this.controls.enabled = !isDragged),
    });
    this.scene.add(this.spark, this.crop, this.frustums, this.moved);
    const poses = views.flatMap((view) => poseOf(view) ?? []);
    this.camera.up.copy(upOf(poses)); // the controls keep what it is when they are made
    this.controls = new OrbitControls(this.camera, canvas);
    this.lookAt(poses);
    if (views[0]) this.goTo(views[0]);
    this.viewpoint = poses
      .reduce((sum, { position }) => sum.add(position), new Vector3())
      .divideScalar(Math.max(1, poses.length));
    this.controls.addEventListener('change', () => this.changed());
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(canvas.parentElement ?? canvas);
  }

  /** Replaces what is drawn when all of the new model is loaded. */
  async load(model: string, parts: readonly SplatPart[]): Promise<void> {
    this.loading.abort();
    this.loading = new AbortController();
    const { signal } = this.loading;
    const loaded = await Promise.all(
      parts.map(async ({ url, tint }) => MarkedSplats.of(await fetchPly(url, signal), tint)),
    );
    if (signal.aborted) {
      for (const part of loaded) part.dispose();
      return;
    }
    for (const old of this.parts) {
      this.scene.remove(old.mesh);
      old.dispose();
    }
    this.parts = loaded;
    // A move may have begun before its model was loaded the first time.
    if (this.model !== '' && model !== this.model) this.moved.stop();
    this.model = model;
    for (const { mesh } of loaded) this.scene.add(mesh);
    this.mark(this.marks);
    const sphere = sphereOf(sampledCenters(loaded));
    // A selection may be loaded first: the scene is the largest of what was loaded.
    if (sphere && sphere.radius > (this.sphere?.radius ?? 0)) this.sphere = sphere;
    this.frustums.fit(cameraShare * (this.sphere?.radius ?? 0));
    this.putReach();
    this.draw();
  }

  /** Draws Gaussians as picked, or not at all, once their model is loaded; undefined: all as they are. */
  mark(marks: Marks | undefined): void {
    this.marks = marks;
    if (marks?.model === this.model) for (const part of this.parts) part.mark(marks);
    this.draw();
  }

  /** Returns the model's Gaussians that are drawn; nothing before the first marks. */
  drawn(): GaussianSet {
    const set = new Uint8Array(this.marks?.hidden.length ?? 0);
    if (this.marks?.model !== this.model) return set;
    for (const part of this.parts) part.addTo(set, this.marks);
    const { hidden } = this.marks;
    return set.map((isIn, i) => (hidden[i] ? 0 : isIn));
  }

  /** Returns how Gaussians come onto the screen now. */
  sight(): Sight {
    this.camera.updateMatrixWorld();
    const { projectionMatrix, matrixWorldInverse } = this.camera;
    const matrix = new Matrix4().multiplyMatrices(projectionMatrix, matrixWorldInverse);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return { matrix: matrix.elements, width, height };
  }

  /** Lets a drag turn the view, or leaves it to who draws over it. The other buttons and two fingers move the view. */
  letTurn(turns: boolean): void {
    this.controls.mouseButtons.LEFT = turns ? MOUSE.ROTATE : null;
    this.controls.touches.ONE = turns ? TOUCH.ROTATE : null;
  }

  goTo(view: View): void {
    const pose = poseOf(view);
    if (!pose) return;
    const distance = this.camera.position.distanceTo(this.controls.target) || 1;
    const ahead = new Vector3(0, 0, -1).applyQuaternion(pose.rotation);
    const toTarget = this.controls.target.clone().sub(pose.position).dot(ahead);
    this.camera.position.copy(pose.position);
    this.controls.target
      .copy(pose.position)
      .addScaledVector(ahead, toTarget > 0.05 ? toTarget : distance);
    this.lens = lensOf(view);
    this.jump();
    this.isAtView = true;
  }

  /** Returns where the camera is; undefined if it is that of the newest view. */
  place(): CameraPlace | undefined {
    if (this.isAtView) return undefined;
    const [position, target] = [this.camera.position.toArray(), this.controls.target.toArray()];
    return { position, target, lens: this.lens };
  }

  putAt({ position, target, lens }: CameraPlace): void {
    this.camera.position.set(...position);
    this.controls.target.set(...target);
    this.lens = lens;
    this.jump();
  }

  showCameras(areShown: boolean): void {
    this.frustums.visible = areShown;
    this.draw();
  }

  /** Returns the view whose camera is at a position, given as shares of width and height. */
  viewAt(x: number, y: number): string | undefined {
    const { clientWidth, clientHeight } = this.canvas;
    return this.frustums.viewAt({ x, y }, this.camera, clientWidth, clientHeight);
  }

  emphasise(view: string): void {
    this.frustums.emphasise(view);
    this.draw();
  }

  /** Shows all of the scene, from the side of the views; nothing until a model is loaded. */
  home(): void {
    if (!this.sphere) return;
    const { center, radius } = this.sphere;
    const away = this.viewpoint.clone().sub(center);
    if (away.lengthSq() < 1e-12) away.copy(this.camera.position).sub(center);
    const distance = radius / Math.sin(Math.atan(Math.min(homeLens.across, homeLens.up)));
    this.controls.target.copy(center);
    this.camera.position.copy(center).add(away.setLength(distance));
    this.lens = homeLens;
    this.jump();
  }

  /** Turns about what is at a position, given as shares of width and height, from now on. */
  pivotAt(x: number, y: number): void {
    const [hit] = this.rayCaster(x, y).intersectObjects(
      this.parts.map(({ mesh }) => mesh),
      false,
    );
    if (!hit) return;
    this.controls.target.copy(hit.point);
    this.jump();
  }

  /** Returns the line of sight through a position, given as shares of width and height. */
  rayAt(x: number, y: number): Ray {
    return this.rayCaster(x, y).ray;
  }

  /** Shows the crop box with its handles, or none. */
  showCrop(box: CropBox | undefined): void {
    this.crop.put(box);
    this.draw();
  }

  /** Turns by angles, radians, about the target; `closer` multiplies the distance. */
  turn(around: number, over: number, closer = 1): void {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const right = new Vector3().crossVectors(this.camera.up, arm).normalize();
    arm.applyAxisAngle(this.camera.up, around);
    const tilted = arm.clone().applyAxisAngle(right, over);
    const fromUp = tilted.angleTo(this.camera.up);
    if (fromUp > 0.05 && fromUp < Math.PI - 0.05) arm.copy(tilted);
    this.camera.position.copy(this.controls.target).addScaledVector(arm, closer);
    this.controls.update();
    this.changed();
  }

  /** Returns the camera of the picture on the screen, at the size that prompts use. */
  shownCamera(): FreeCamera {
    const { clientWidth, clientHeight } = this.canvas;
    const scale = Math.min(1, maxPictureHeight / clientHeight);
    const [width, height] = [Math.round(clientWidth * scale), Math.round(clientHeight * scale)];
    return freeCameraOf(this.camera, Math.max(1, width), Math.max(1, height));
  }

  end(): void {
    this.loading.abort();
    cancelAnimationFrame(this.drawing);
    this.sizes.disconnect();
    this.controls.dispose();
    this.crop.dispose();
    this.moved.stop();
    this.frustums.dispose();
    for (const part of this.parts) part.dispose();
    this.renderer.dispose();
  }

  private rayCaster(x: number, y: number): Raycaster {
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2(2 * x - 1, 1 - 2 * y), this.camera);
    return caster;
  }

  private lookAt(poses: readonly Pose[]): void {
    const first = poses[0];
    if (!first) return;
    const ahead = new Vector3(0, 0, -1).applyQuaternion(first.rotation);
    const focus = focusOf(poses);
    const distance = focus ? Math.max(0.1, focus.sub(first.position).dot(ahead)) : 1;
    this.camera.position.copy(first.position);
    this.controls.target.copy(first.position).addScaledVector(ahead, distance);
  }

  /** Shows all that the view's camera sees, whatever the shape of the pane. */
  private fit(): void {
    this.camera.fov = fieldOfView(this.lens, this.camera.aspect);
    this.camera.updateProjectionMatrix();
  }

  /** Shows what the camera was set to. Where it was put, it may stay. */
  private jump(): void {
    this.putReach();
    this.fit();
    this.controls.update();
    this.changed();
  }

  private putReach(): void {
    const { target } = this.controls;
    this.reach = this.sphere && reachOf(this.sphere, this.camera.position, target);
  }

  private changed(): void {
    this.isAtView = false;
    const { target } = this.controls;
    if (this.reach && keepWithin(this.reach, this.camera.position, target)) {
      this.camera.lookAt(target);
    }
    this.onMoved();
    this.draw();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.camera.aspect = clientWidth / clientHeight;
    this.fit();
    this.renderer.setSize(clientWidth, clientHeight, false);
    const { isAtView } = this;
    this.changed();
    this.isAtView = isAtView;
  }

  /**
   * Requests one new picture for all changes before it; without changes, and while the pane is hidden,
   * nothing is drawn.
   */
  private draw(): void {
    if (this.drawing || this.canvas.clientWidth === 0) return;
    this.drawing = requestAnimationFrame(() => {
      this.drawing = 0;
      this.crop.fitTo(this.camera);
      this.renderer.render(this.scene, this.camera);
    });
  }
}
