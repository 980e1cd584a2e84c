// The RPCs that the app calls, forwarded to the server unchanged. Others cannot be reached through the
// app; files have their own routes (upload.ts, ply.ts, mesh.ts, picture.ts, photo.ts). The zip of
// annotations has none: its RPC reports progress.
import type { DescMessage, MessageShape } from '@bufbuild/protobuf';
import type { ConnectRouter, HandlerContext } from '@connectrpc/connect';
import { DatasetService } from '../gen/pepeseg/v1/dataset_service_pb';
import { EditService } from '../gen/pepeseg/v1/edit_service_pb';
import { JobService } from '../gen/pepeseg/v1/job_service_pb';
import { LabelService } from '../gen/pepeseg/v1/label_service_pb';
import { SceneService } from '../gen/pepeseg/v1/scene_service_pb';
import { SegmentationService } from '../gen/pepeseg/v1/segmentation_service_pb';
import { SelectionService } from '../gen/pepeseg/v1/selection_service_pb';
import type { BackEnd } from './back_end';
import { routing } from './channel';
import { learnScenes } from './job_scenes';
import { passedOn } from './passed_on';

/** The first query of a model loads it. */
const defaultTimeoutMs = 120_000;

type Message = MessageShape<DescMessage>;

/** Returns the resource by which a request is routed: a scene, a resource of one, or a job. */
export function resourceOf(request: Message): string | undefined {
  const fields = request as unknown as Record<string, unknown>;
  for (const field of ['scene', 'parent', 'model', 'name', 'first']) {
    const value = fields[field];
    if (typeof value === 'string' && /^(scenes|jobs)\//.test(value)) return value;
  }
  return undefined;
}

type UnaryCall = (request: Message, options: object) => Promise<Message>;
type StreamCall = (request: Message, options: object) => AsyncIterable<Message>;

function passUnary(call: UnaryCall) {
  return async (request: Message, context: HandlerContext) => {
    try {
      const answer = await call(request, {
        signal: context.signal,
        timeoutMs: context.timeoutMs() ?? defaultTimeoutMs,
        headers: routing(resourceOf(request)),
      });
      learnScenes(answer);
      return answer;
    } catch (error) {
      throw passedOn(error, context.signal);
    }
  };
}

function passStream(call: StreamCall) {
  return async function* (request: Message, context: HandlerContext) {
    try {
      const options = { signal: context.signal, headers: routing(resourceOf(request)) };
      for await (const message of call(request, options)) {
        learnScenes(message);
        yield message;
      }
    } catch (error) {
      throw passedOn(error, context.signal);
    }
  };
}

export function addRoutes(router: ConnectRouter, { channel }: BackEnd): void {
  const { scenes, datasets, jobs, segmentation, labels, selections, editing } = channel;
  const own = new Set(['writeFiles', 'streamSegments', 'getPhotograph']);
  const pairs = [
    [SceneService, scenes],
    [DatasetService, datasets],
    [JobService, jobs],
    [SegmentationService, segmentation],
    [LabelService, labels],
    [SelectionService, selections],
    [EditService, editing],
  ] as const;
  for (const [service, client] of pairs) {
    const calls = client as unknown as Record<string, UnaryCall & StreamCall>;
    for (const method of service.methods) {
      const call = calls[method.localName];
      if (own.has(method.localName) || !call) continue;
      if (method.methodKind === 'unary') {
        router.rpc(method, passUnary(call) as never);
      } else if (method.methodKind === 'server_streaming') {
        router.rpc(method, passStream(call) as never);
      }
    }
  }
}
