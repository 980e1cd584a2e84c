// Prompts: a view, or a picture of the 3D view, and what is meant in it.
import type { MessageInitShape } from '@bufbuild/protobuf';
import { create } from '@bufbuild/protobuf';
import type {
  GranularitySchema,
  Prompt as PromptMessage,
  PromptSchema,
} from '../../gen/pepeseg/v1/prompt_pb';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { SegmentViewsRequest } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { SegmentViewsRequestSchema } from '../../gen/pepeseg/v1/segmentation_service_pb';
import type { Rle } from '../mask/rle';

/** Returns the size, in pixels, of the frame of a view's prompts and masks: its photograph's. */
export function sizeOf(view: View): { readonly width: number; readonly height: number } {
  const { photographWidth, photographHeight, camera } = view;
  // A view without a photograph: the frame is the view's.
  if (photographWidth > 0 && photographHeight > 0) {
    return { width: photographWidth, height: photographHeight };
  }
  return { width: camera?.width || 1, height: camera?.height || 1 };
}

interface Vector {
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

/** A pinhole camera anywhere, as in the contract. */
export interface FreeCamera {
  readonly width: number;
  readonly height: number;
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
  /** Those of cam_from_world. */
  readonly rotation: { readonly w: number } & Vector;
  readonly translation: Vector;
}

export type Place = { readonly view: string } | { readonly camera: FreeCamera };

export interface Point {
  readonly x: number;
  readonly y: number;
  readonly negative: boolean;
}

export interface Box {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** A line that is drawn by hand; one vertex is a dot. */
export interface Stroke {
  readonly path: readonly { readonly x: number; readonly y: number }[];
  /** Whether it is over what is not meant. */
  readonly negative: boolean;
  /** Pixels, at most `maxStrokeWidth`. 0: thin. */
  readonly width: number;
}

export const maxStrokeWidth = 256;

/** Means what a mask of a view shows. */
export interface MaskPrompt {
  readonly kind: 'mask';
  readonly place: { readonly view: string };
  readonly rle: Rle;
  /** Whether the mask is accepted as it is: in its own view it is the answer. */
  readonly isExact: boolean;
  /** The segment of a decomposition whose mask it is, with the decomposition's default scales. */
  readonly segment?: { readonly level: number; readonly id: number };
}

export type Prompt =
  | { readonly kind: 'points'; readonly place: Place; readonly points: readonly Point[] }
  | { readonly kind: 'scribbles'; readonly place: Place; readonly strokes: readonly Stroke[] }
  | { readonly kind: 'box'; readonly place: Place; readonly box: Box }
  | MaskPrompt
  | { readonly kind: 'label'; readonly label: string }
  /** What the server found: its own prompt for it. */
  | { readonly kind: 'found'; readonly message: PromptMessage };

/** Scale and threshold; the server chooses those that are absent. */
export interface Granularity {
  readonly scale?: number | undefined;
  readonly threshold?: number | undefined;
}

const names: Readonly<Record<Prompt['kind'], string>> = {
  points: 'Click',
  scribbles: 'Stroke',
  box: 'Box',
  mask: 'Mask',
  label: 'Named thing',
  found: 'Found thing',
};

/** Returns what a person did to make the prompt, for the history. */
export function nameOf({ kind }: Prompt): string {
  return names[kind];
}

export function samePlace(a: Place | undefined, b: Place | undefined): boolean {
  if (!a || !b) return false;
  if ('view' in a) return 'view' in b && a.view === b.view;
  return 'camera' in b && a.camera === b.camera;
}

export function placeOf(prompt: Prompt | undefined): Place | undefined {
  return prompt && 'place' in prompt ? prompt.place : undefined;
}

/** Returns the name of the prompt's view: empty for the picture of the 3D view, and without a place. */
export function ownViewOf(prompt: Prompt): string {
  const place = placeOf(prompt);
  return place && 'view' in place ? place.view : '';
}

/** Returns whether the prompt is the mask of the prompt before it, changed by hand. */
export function isEdited(prompt: Prompt): boolean {
  return prompt.kind === 'mask' && prompt.isExact && prompt.segment === undefined;
}

/** Returns whether the prompt is in a picture of the 3D view. */
export function isIn3d(prompt: Prompt): boolean {
  const place = placeOf(prompt);
  return place !== undefined && 'camera' in place;
}

function viewpointOf(place: Place): NonNullable<MessageInitShape<typeof PromptSchema>['view']> {
  if ('view' in place) return { place: { case: 'view', value: place.view } };
  const { rotation, translation, ...camera } = place.camera;
  const transform = { rotation, translation };
  return { place: { case: 'free', value: { camera, camFromWorld: transform } } };
}

export function promptOf(prompt: Prompt): MessageInitShape<typeof PromptSchema> {
  if (prompt.kind === 'label') return { what: { case: 'label', value: prompt.label } };
  if (prompt.kind === 'found') return prompt.message;
  const view = viewpointOf(prompt.place);
  if (prompt.kind === 'box') return { view, what: { case: 'box', value: { ...prompt.box } } };
  if (prompt.kind === 'scribbles') {
    const strokes = prompt.strokes.map(({ path, ...stroke }) => ({ ...stroke, path: [...path] }));
    return { view, what: { case: 'scribbles', value: { strokes } } };
  }
  if (prompt.kind === 'mask') {
    const image = { case: 'rle', value: { ...prompt.rle } } as const;
    return { view, what: { case: 'mask', value: { image } } };
  }
  const points = prompt.points.map((point) => ({ ...point }));
  return { view, what: { case: 'points', value: { points } } };
}

export function granularityOf({
  scale,
  threshold,
}: Granularity): MessageInitShape<typeof GranularitySchema> {
  return {
    ...(scale !== undefined && { scale: { case: 'scaleQuantile', value: scale } as const }),
    ...(threshold !== undefined && { threshold }),
  };
}

/** Makes a request. `views`: absent: the prompt's view. */
export function segmentRequest(
  model: string,
  prompt: Prompt,
  granularity: Granularity,
  views?: readonly string[],
): SegmentViewsRequest {
  return create(SegmentViewsRequestSchema, {
    model,
    prompt: promptOf(prompt),
    granularity: granularityOf(granularity),
    ...(views && { targets: { views: [...views] } }),
  });
}
