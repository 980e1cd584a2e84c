// StreamSegments over a WebSocket. Only the newest request matters: while the socket is being opened
// a request replaces the one before, and after a lost connection the newest is sent again.
import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { errorWith } from '../../contract/error_detail';
import type { Error as ErrorMessage } from '../../gen/pepeseg/v1/errors_pb';
import type {
  SegmentViewsRequest,
  SegmentViewsResponse,
} from '../../gen/pepeseg/v1/segmentation_service_pb';
import {
  StreamSegmentsRequestSchema,
  StreamSegmentsResponseSchema,
} from '../../gen/pepeseg/v1/segmentation_service_pb';
import { Backoff } from './server_link';

export interface Answers {
  /** Called with the response to the request with that sequence. */
  answered(sequence: bigint, answer: SegmentViewsResponse): void;
  refused(sequence: bigint, error: unknown): void;
}

function errorOf({ code, message, retryAfter: wait, ...detail }: ErrorMessage): ConnectError {
  const retryMs = wait && Number(wait.seconds) * 1000 + wait.nanos / 1e6;
  return errorWith(code as Code, message, { ...detail, retryMs });
}

export class SegmentSocket {
  private socket: WebSocket | undefined;
  private sequence = 0n;
  private newest: Uint8Array<ArrayBuffer> | undefined;
  /** Who gets the answers, for requests that are not the constructor's. */
  private readonly takers = new Map<bigint, Answers>();
  private answeredUpTo = 0n;
  private readonly backoff = new Backoff();

  constructor(private readonly answers: Answers) {}

  /** Returns the sequence of the request. `taker` gets its answer; absent: who made the socket. */
  ask(segment: SegmentViewsRequest, taker?: Answers): bigint {
    const request = create(StreamSegmentsRequestSchema, { sequence: ++this.sequence, segment });
    if (taker) this.takers.set(this.sequence, taker);
    this.newest = toBinary(StreamSegmentsRequestSchema, request) as Uint8Array<ArrayBuffer>;
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(this.newest);
    else this.open();
    return this.sequence;
  }

  /** Forgets the requests that have no answer yet. A later request opens the socket again. */
  close(): void {
    this.answeredUpTo = this.sequence;
    this.takers.clear();
    const { socket } = this;
    this.socket = undefined;
    if (!socket) return;
    socket.onclose = null;
    socket.onmessage = null;
    socket.close(1000);
  }

  private open(): void {
    if (this.socket) return;
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = new WebSocket(`${scheme}://${location.host}/api/segment-stream`);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    socket.onopen = () => this.newest && socket.send(this.newest);
    socket.onmessage = ({ data }) => this.take(new Uint8Array(data as ArrayBuffer));
    socket.onclose = (event) => void this.lost(event);
  }

  private take(bytes: Uint8Array): void {
    this.backoff.reset();
    const { sequence, outcome } = fromBinary(StreamSegmentsResponseSchema, bytes);
    this.answeredUpTo = sequence;
    const taker = this.takerOf(sequence);
    if (outcome.case === 'segment') taker.answered(sequence, outcome.value);
    if (outcome.case === 'error') taker.refused(sequence, errorOf(outcome.value));
  }

  /** Returns who gets the answer to a request. Requests before it get none any longer. */
  private takerOf(sequence: bigint): Answers {
    const taker = this.takers.get(sequence) ?? this.answers;
    for (const earlier of this.takers.keys()) {
      if (earlier <= sequence) this.takers.delete(earlier);
    }
    return taker;
  }

  private async lost(event: CloseEvent): Promise<void> {
    this.socket = undefined;
    // An idle socket is opened again for the next request.
    if (this.answeredUpTo === this.sequence) return;
    const code = event.code > 4000 ? ((event.code - 4000) as Code) : Code.Unavailable;
    if (code !== Code.Unavailable && code !== Code.Canceled) {
      this.answeredUpTo = this.sequence;
      this.takerOf(this.sequence).refused(this.sequence, new ConnectError(event.reason, code));
      return;
    }
    await this.backoff.wait('The server does not answer.', undefined);
    if (this.answeredUpTo < this.sequence) this.open();
  }
}
