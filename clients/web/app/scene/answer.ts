// The server's answers, as the screen shows them.
import type {
  ProposeScalesResponse,
  SegmentViewsResponse,
} from '../../gen/pepeseg/v1/segmentation_service_pb';
import { SegmentViewsResponse_BorderImage } from '../../gen/pepeseg/v1/segmentation_service_pb';
import type { Rle } from '../mask/rle';

export interface Mask {
  /** Name of the view; empty: the picture of the 3D view. */
  readonly view: string;
  readonly rle: Rle;
  readonly area: number;
  readonly score: number;
  /** x, y, width, height. */
  readonly box: readonly number[];
  /** The picture in which SAM placed the mask or its border; absent: SAM did not. */
  readonly samImage?: 'photograph' | 'rendering' | undefined;
}

export interface Answer {
  /** Masks by view. */
  readonly masks: ReadonlyMap<string, Mask>;
  readonly scale: number;
  readonly scaleUnits: number;
  readonly threshold: number;
  readonly computeMs: number;
}

export interface Proposal {
  readonly scale: number;
  readonly threshold: number;
  /** Whether the server uses this proposal if nothing is chosen. */
  readonly best: boolean;
  readonly mask: Mask;
}

const samImages: Partial<Record<SegmentViewsResponse_BorderImage, Mask['samImage']>> = {
  [SegmentViewsResponse_BorderImage.PHOTOGRAPH]: 'photograph',
  [SegmentViewsResponse_BorderImage.RENDERING]: 'rendering',
};

function maskOf({
  view,
  mask,
  area,
  score,
  box,
  borderImage,
}: SegmentViewsResponse['masks'][number]): Mask | undefined {
  if (mask.case !== 'rle') return undefined;
  const { height, width, counts } = mask.value;
  const edges = box ? [box.x, box.y, box.width, box.height] : [0, 0, 0, 0];
  const rle = { height, width, counts };
  return { view, rle, area: Number(area), score, box: edges, samImage: samImages[borderImage] };
}

export function answerOf(response: SegmentViewsResponse): Answer {
  const masks = response.masks.map(maskOf).filter((mask): mask is Mask => mask !== undefined);
  const compute = response.timing?.compute;
  return {
    masks: new Map(masks.map((mask) => [mask.view, mask])),
    scale: response.scaleQuantile,
    scaleUnits: response.scaleUnits,
    threshold: response.threshold,
    computeMs: compute ? Number(compute.seconds) * 1000 + compute.nanos / 1e6 : 0,
  };
}

/** Returns the server's proposals, in its order. */
export function proposalsOf({ proposals, best }: ProposeScalesResponse): Proposal[] {
  return proposals.flatMap(({ mask, scaleQuantile, threshold }, i) => {
    const shown = mask && maskOf(mask);
    return shown ? [{ scale: scaleQuantile, threshold, best: i === best, mask: shown }] : [];
  });
}
