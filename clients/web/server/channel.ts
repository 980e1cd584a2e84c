// The connection to pepesegd: one HTTP/2 session, which is opened again when it is lost.
import type { Client, Interceptor } from '@connectrpc/connect';
import { Code, ConnectError, createClient } from '@connectrpc/connect';
import { createGrpcTransport } from '@connectrpc/connect-node';
import { setTimeout } from 'node:timers/promises';
import { DatasetService } from '../gen/pepeseg/v1/dataset_service_pb';
import { ErrorDetailSchema } from '../gen/pepeseg/v1/errors_pb';
import { JobService } from '../gen/pepeseg/v1/job_service_pb';
import { SceneService } from '../gen/pepeseg/v1/scene_service_pb';
import { SegmentationService } from '../gen/pepeseg/v1/segmentation_service_pb';
import type { Config } from './config';

/** Time limit of a call without a deadline. */
const longestWaitMs = 120_000;

export interface Channel {
  readonly scenes: Client<typeof SceneService>;
  readonly datasets: Client<typeof DatasetService>;
  readonly jobs: Client<typeof JobService>;
  readonly segmentation: Client<typeof SegmentationService>;
}

/** Returns the headers of a call about a resource, by which the gateway routes a scene's calls. */
export function routing(resource: string | undefined): Record<string, string> {
  const scene = /^scenes\/([^/]+)/.exec(resource ?? '')?.[1];
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
  const detail = from.findDetails(ErrorDetailSchema)[0];
  // A stopping server is not waited for: the app says so.
  if (from.code !== Code.Unavailable || !detail?.retryAfter || detail.reason === 'DRAINING') {
    return undefined;
  }
  return Number(detail.retryAfter.seconds) * 1000 + detail.retryAfter.nanos / 1e6;
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
  };
}
