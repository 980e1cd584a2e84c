// The connection to pepesegd: one HTTP/2 session, opened anew when it was lost.
import type { Client, Interceptor } from '@connectrpc/connect';
import { createClient } from '@connectrpc/connect';
import { createGrpcTransport } from '@connectrpc/connect-node';
import { DatasetService } from '../gen/pepeseg/v1/dataset_service_pb';
import { JobService } from '../gen/pepeseg/v1/job_service_pb';
import { SceneService } from '../gen/pepeseg/v1/scene_service_pb';
import { SegmentationService } from '../gen/pepeseg/v1/segmentation_service_pb';
import type { Config } from './config';

export interface Channel {
  readonly scenes: Client<typeof SceneService>;
  readonly datasets: Client<typeof DatasetService>;
  readonly jobs: Client<typeof JobService>;
  readonly segmentation: Client<typeof SegmentationService>;
}

/** The headers of a call about a resource: the gateway sends a scene's calls to one server. */
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

export function openChannel(config: Config): Channel {
  const transport = createGrpcTransport({
    baseUrl: config.serverUrl,
    interceptors: config.key ? [showKey(config.key)] : [],
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
