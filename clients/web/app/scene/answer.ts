// What the server answered, as the screen shows it.
import type { ProposeScalesResponse, SegmentResponse } from '../../gen/pepeseg/v1/segmentation_service_pb';
import type { Rle } from '../mask/rle';

export interface Mask {
  /** Empty: the picture of the 3D view. */
  readonly view: string;
  readonly rle: Rle;
  readonly area: number;
  readonly score: number;
  /** x, y, width, height. */
  readonly box: readonly number[];
}

export interface Answer {
  /** By view. */
  readonly masks: ReadonlyMap<string, Mask>;
  readonly scale: number;
  readonly scaleUnits: number;
  readonly threshold: number;
  readonly computeMs: number;
}

export interface Proposal {
  readonly name: string;
  readonly scale: number;
  readonly threshold: number;
  readonly support: number;
  readonly mask: Mask;
}

function maskOf({ view, mask, area, score, box }: SegmentResponse['masks'][number]): Mask | undefined {
  if (mask.case !== 'rle') return undefined;
  const { height, width, counts } = mask.value;
  const edges = box ? [box.x, box.y, box.width, box.height] : [0, 0, 0, 0];
  return { view, rle: { height, width, counts }, area: Number(area), score, box: edges };
}

export function answerOf(response: SegmentResponse): Answer {
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

const names: readonly (readonly string[])[] = [[], ['Object'], ['Part', 'Object'], ['Part', 'Object', 'Group']];

/** The three that most scales and thresholds show, the smallest thing first. */
export function proposalsOf({ proposals }: ProposeScalesResponse): Proposal[] {
  const best = proposals.flatMap(({ mask, scaleQuantile, threshold, support }) => {
    const shown = mask && maskOf(mask);
    return shown ? [{ scale: scaleQuantile, threshold, support, mask: shown }] : [];
  });
  const three = best.slice(0, 3).sort((a, b) => a.mask.area - b.mask.area);
  return three.map((proposal, i) => ({ name: names[three.length]?.[i] ?? '', ...proposal }));
}
