import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import {
  SegmentViewsRequestSchema,
  StreamSegmentsRequestSchema,
  StreamSegmentsResponseSchema,
} from '../../gen/pepeseg/v1/segmentation_service_pb';

/** A socket that is open, and answers what a test says. */
class FakeWebSocket {
  static readonly OPEN = 1;
  static newest: FakeWebSocket | undefined;
  readyState = FakeWebSocket.OPEN;
  readonly sent: bigint[] = [];
  onmessage: (message: { data: ArrayBuffer }) => void = () => undefined;
  onopen: () => void = () => undefined;

  constructor() {
    FakeWebSocket.newest = this;
  }

  send(bytes: Uint8Array): void {
    this.sent.push(fromBinary(StreamSegmentsRequestSchema, bytes).sequence);
  }

  close(): void {
    this.readyState = 3;
  }

  answer(sequence: bigint): void {
    const outcome = { case: 'segment', value: {} } as const;
    const message = create(StreamSegmentsResponseSchema, { sequence, outcome });
    this.onmessage({ data: toBinary(StreamSegmentsResponseSchema, message).slice().buffer });
  }
}

test.beforeEach(() => {
  const location = { protocol: 'http:', host: 'localhost' };
  Object.assign(globalThis, { window: new EventTarget(), WebSocket: FakeWebSocket, location });
});
test.afterEach(() => {
  for (const name of ['window', 'WebSocket', 'location']) Reflect.deleteProperty(globalThis, name);
});

test('a socket that was closed is opened for the next request', async () => {
  const { SegmentSocket } = await import('../../app/api/segment_socket');
  const got: bigint[] = [];
  const socket = new SegmentSocket({
    answered: (sequence) => void got.push(sequence),
    refused: () => undefined,
  });
  socket.ask(create(SegmentViewsRequestSchema, {}));
  const first = FakeWebSocket.newest;
  first?.onopen();
  socket.close();
  expect(first?.readyState).toBe(3);
  socket.ask(create(SegmentViewsRequestSchema, {}));
  const second = FakeWebSocket.newest;
  expect(second).not.toBe(first);
  second?.onopen();
  second?.answer(2n);
  expect([first?.sent, second?.sent, got]).toEqual([[1n], [2n], [2n]]);
});

test('an answer goes to who asked, and to nobody twice', async () => {
  const { SegmentSocket } = await import('../../app/api/segment_socket');
  const got: string[] = [];
  const taker = (name: string) => ({
    answered: (sequence: bigint) => void got.push(`${name} ${sequence}`),
    refused: () => undefined,
  });
  const socket = new SegmentSocket(taker('session'));
  const request = create(SegmentViewsRequestSchema, {});
  socket.ask(request);
  FakeWebSocket.newest?.onopen();
  socket.ask(request, taker('preview'));
  socket.ask(request, taker('newer preview'));
  FakeWebSocket.newest?.answer(1n);
  FakeWebSocket.newest?.answer(3n);
  expect(FakeWebSocket.newest?.sent).toEqual([1n, 2n, 3n]);
  expect(got).toEqual(['session 1', 'newer preview 3']);
  socket.close();
});
