// The server's answers, as the screen shows them.
import type {
  ProposeScalesResponse,
  SegmentViewsResponse,
} from '../../gen/pepeseg/v1/segmentation_service_pb';
import { ProposeScalesResponse_Kind } from '../../gen/pepeseg/v1/segmentation_service_pb';
import type { Rle } from '../mask/rle';

export interface Mask {
  /** Name of the view; empty: the picture of the 3D view. */
  readonly view: string;
  readonly rle: Rle;
  readonly area: number;
  readonly score: number;
  /** x, y, width, height. */
  readonly box: readonly number[];
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
  readonly name: string;
  readonly scale: number;
  readonly threshold: number;
  readonly support: number;
  /** Whether the server uses this proposal if nothing is chosen. */
  readonly best: boolean;
  readonly mask: Mask;
}

function maskOf({
  view,
  mask,
  area,
  score,
  box,
}: SegmentViewsResponse['masks'][number]): Mask | undefined {
  if (mask.case !== 'rle') return undefined;
  const { height, width, counts } = mask.value;
  const edges = box ? [box.x, box.y, box.width, box.height] : [0, 0, 0, 0];
  return { view, rle: { height, width, counts }, area: Number(area), score, box: edges };
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

const kindNames: Record<ProposeScalesResponse_Kind, string> = {
  [ProposeScalesResponse_Kind.UNSPECIFIED]: '',
  [ProposeScalesResponse_Kind.PART]: 'Part',
  [ProposeScalesResponse_Kind.OBJECT]: 'Object',
  [ProposeScalesResponse_Kind.GROUP]: 'Group',
};

/**
 * Returns the server's proposals, smallest first, with the server's names. A proposal without a name,
 * or with the name of another one, is named by its position ("2"); the only one is the object.
 */
export function proposalsOf({ proposals, best }: ProposeScalesResponse): Proposal[] {
  const kinds = proposals.map(({ kind }) => kindNames[kind] ?? '');
  return proposals.flatMap(({ mask, scaleQuantile, threshold, support }, i) => {
    const shown = mask && maskOf(mask);
    if (!shown) return [];
    const kind = kinds[i] ?? '';
    const place = String(i + 1);
    const shared = kinds.filter((other) => other === kind).length > 1;
    const alone = proposals.length === 1 ? kindNames[ProposeScalesResponse_Kind.OBJECT] : place;
    const name = kind === '' ? alone : shared ? `${kind} ${place}` : kind;
    return [{ name, scale: scaleQuantile, threshold, support, best: i === best, mask: shown }];
  });
}
