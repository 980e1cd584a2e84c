// Work on all Gaussians of a model that takes long, outside the page's thread.
import type { SightOfPhotograph } from './floaters';
import { floatersAmong } from './floaters';
import type { GaussianPly } from './gaussian_ply';
import { readGaussianPly } from './gaussian_ply';
import type { GaussianSet } from './gaussian_set';

export type WorkRequest =
  | { readonly id: number; readonly file: Blob }
  | {
      readonly id: number;
      readonly gaussians: GaussianPly;
      readonly photographs: readonly SightOfPhotograph[];
    };

export interface WorkAnswer {
  readonly id: number;
  readonly value?: GaussianPly | GaussianSet;
  /** The error, if there is no value. */
  readonly error?: string;
}

async function work(request: WorkRequest): Promise<GaussianPly | GaussianSet> {
  if ('file' in request) return readGaussianPly(await request.file.arrayBuffer());
  return floatersAmong(request.gaussians, request.photographs);
}

self.onmessage = async ({ data }: MessageEvent<WorkRequest>) => {
  try {
    self.postMessage({ id: data.id, value: await work(data) } satisfies WorkAnswer);
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    self.postMessage({ id: data.id, error: reason } satisfies WorkAnswer);
  }
};
