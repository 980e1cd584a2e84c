// WebSocket /api/segment-stream: StreamSegments for browsers, whose gRPC has no streams in both
// directions. A message is a StreamSegmentsRequest or a StreamSegmentsResponse, as Protobuf bytes.
import { fromBinary, toBinary } from '@bufbuild/protobuf';
import type { WebSocket } from 'ws';
import type { StreamSegmentsRequest } from '../gen/pepeseg/v1/segmentation_service_pb';
import {
  StreamSegmentsRequestSchema,
  StreamSegmentsResponseSchema,
} from '../gen/pepeseg/v1/segmentation_service_pb';
import type { ConnectError } from '@connectrpc/connect';
import { Code } from '@connectrpc/connect';
import type { Channel } from './channel';
import { routing } from './channel';
import { passedOn } from './passed_on';

/** The newest request that was not forwarded yet; it has replaced older ones. */
export class Newest<T> implements AsyncIterable<T> {
  private waiting: T | undefined;
  private ended = false;
  private wake: (() => void) | undefined;

  put(value: T): void {
    this.waiting = value;
    this.wake?.();
  }

  end(): void {
    this.ended = true;
    this.wake?.();
  }

  async *[Symbol.asyncIterator](): AsyncGenerator<T> {
    while (!this.ended) {
      if (this.waiting === undefined) {
        await new Promise<void>((resolve) => (this.wake = resolve));
        continue;
      }
      const value = this.waiting;
      this.waiting = undefined;
      yield value;
    }
  }
}

/** WebSocket close codes for applications: 4000 plus the gRPC code. */
function closeWith(socket: WebSocket, { code, rawMessage }: ConnectError): void {
  socket.close(4000 + code, Buffer.from(rawMessage).subarray(0, 120).toString());
}

export function serveSegmentStream(channel: Channel, socket: WebSocket): void {
  const requests = new Newest<StreamSegmentsRequest>();
  const gone = new AbortController();
  let started = false;

  const start = async (model: string) => {
    try {
      const options = { signal: gone.signal, headers: routing(model) };
      for await (const answer of channel.segmentation.streamSegments(requests, options)) {
        socket.send(toBinary(StreamSegmentsResponseSchema, answer));
      }
      // The server ends a stream only when it stops.
      socket.close(4000 + Code.Unavailable);
    } catch (error) {
      closeWith(socket, passedOn(error, gone.signal));
    }
  };

  socket.on('message', (data: Buffer, isBinary: boolean) => {
    if (!isBinary) return socket.close(1003);
    try {
      const request = fromBinary(StreamSegmentsRequestSchema, data);
      requests.put(request);
      if (!started) void start(request.segment?.model ?? '');
      started = true;
    } catch {
      socket.close(1007);
    }
  });
  socket.on('error', () => socket.terminate());
  socket.on('close', () => {
    requests.end();
    gone.abort();
  });
}
