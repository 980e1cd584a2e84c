// Advice for annotators about the masks that a scene was trained on. The server's own advice, for
// operators, is in the notes of a training.
import type { Dataset } from '../../gen/pepeseg/v1/dataset_service_pb';
import type { Model } from '../../gen/pepeseg/v1/scene_service_pb';

/** Below this mask quality segments may be poor: Model.metrics in scene_service.proto. */
const goodMaskQuality = 0.5;

const rough = 'Segments may be rough here';
const remedy = 'check their borders in several views.';

/** Returns one sentence about a model; undefined if its masks are good. */
export function adviceOnModel({
  metrics,
  sources,
  advice,
}: Pick<Model, 'metrics' | 'sources' | 'advice'>): string | undefined {
  if (sources?.masks === 'none') {
    return 'This scene was trained without masks: look at it, but it cannot be segmented.';
  }
  const quality = metrics['mask_quality'];
  if (quality === undefined) return advice.length > 0 ? `${rough}: ${remedy}` : undefined;
  if (quality >= goodMaskQuality) return undefined;
  return `${rough} (mask quality ${quality.toFixed(2)} of 1): ${remedy}`;
}

/** Returns one sentence about a dataset; undefined if the server has no advice. */
export function adviceOnDataset({ advice }: Pick<Dataset, 'advice'>): string | undefined {
  if (advice.length === 0) return undefined;
  return 'No masks were uploaded: the server makes simple ones, and segments may be rough.';
}
