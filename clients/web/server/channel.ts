// The connection to pepesegd: one HTTP/2 session, which is opened again when it is lost.
import type { Client, Interceptor } from '@connectrpc/connect';
import { Code, ConnectError, createClient } from '@connectrpc/connect';
import { createGrpcTransport } from '@connectrpc/connect-node';
import { setTimeout } from 'node:timers/promises';
import { detailOf } from '../contract/error_detail';
import { DatasetService } from '../gen/pepeseg/v1/dataset_service_pb';
import { EditService } from '../gen/pepeseg/v1/edit_service_pb';
import { JobService } from '../gen/pepeseg/v1/job_service_pb';
import { LabelService } from '../gen/pepeseg/v1/label_service_pb';
import { RenderService } from '../gen/pepeseg/v1/render_service_pb';
import { SceneService } from '../gen/pepeseg/v1/scene_service_pb';
import { SegmentationService } from '../gen/pepeseg/v1/segmentation_service_pb';
import { SelectionService } from '../gen/pepeseg/v1/selection_service_pb';
import type { Config } from './config';
import { sceneOfJob } from './job_scenes';

/** Time limit of a call without a deadline. */
const longestWaitMs = 120_000;

export interface Channel {
  readonly scenes: Client<typeof SceneService>;
  readonly datasets: Client<typeof DatasetService>;
  readonly jobs: Client<typeof JobService>;
  readonly segmentation: Client<typeof SegmentationService>;
  readonly labels: Client<typeof LabelService>;
  readonly selections: Client<typeof SelectionService>;
  readonly editing: Client<typeof EditService>;
  readonly rendering: Client<typeof RenderService>;
}

/** Returns the headers of a call about a resource, by which the gateway routes a scene's calls. */
export function routing(resource: string | undefined): Record<string, string> {
  const named = (resource && sceneOfJob(resource)) ?? resource;
  const scene = /^scenes\/([^/]+)/.exec(named ?? '')?.[1];
  return scene ? { 'x-scene': scene } : {};
}

function showKey(key: string): Interceptor {
  return (next) => (request) => {
    request.header.set('authorization', `Bearer ${key}`);
    return next(request);
  };
}

/** Returns the milliseconds after which a call that the server refused may be repeated. */
export function retryMs(error: unknown): number | undefined {
  const from = ConnectError.from(error);
  const detail = detailOf(from);
  // The app says that it waits for a stopping server, or for the first state of a training.
  const isShown = detail?.reason === 'DRAINING' || detail?.reason === 'NO_SNAPSHOT';
  if (from.code !== Code.Unavailable || isShown) return undefined;
  return detail?.retryMs;
}

/** Repeats calls that the server refused, until their deadline or until nobody waits. */
export const retryAsTold: Interceptor = (next) => async (request) => {
  for (let waited = 0; ;) {
    try {
      return await next(request);
    } catch (error) {
      const wait = request.stream ? undefined : retryMs(error);
      waited += wait ?? 0;
      if (wait === undefined || waited > longestWaitMs || request.signal.aborted) throw error;
      await setTimeout(wait, undefined, { signal: request.signal });
    }
  }
};

export function openChannel(config: Config): Channel {
  const transport = createGrpcTransport({
    baseUrl: config.serverUrl,
    interceptors: config.key ? [retryAsTold, showKey(config.key)] : [retryAsTold],
    nodeOptions: config.serverUrl.startsWith('https:') ? config.tls : {},
    readMaxBytes: 64 << 20,
  });
  return {
    scenes: createClient(SceneService, transport),
    datasets: createClient(DatasetService, transport),
    jobs: createClient(JobService, transport),
    segmentation: createClient(SegmentationService, transport),
    labels: createClient(LabelService, transport),
    selections: createClient(SelectionService, transport),
    editing: createClient(EditService, transport),
    rendering: createClient(RenderService, transport),
  };
}
