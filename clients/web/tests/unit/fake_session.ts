// A session without a network: the stream's answers are given by hand, and calls are functions of a test.
import type { SegmentViewsRequest } from '../../gen/pepeseg/v1/segmentation_service_pb';
import type { SegmentSocket } from '../../app/api/segment_socket';
import type { SceneSession } from '../../app/scene/session';

export const model = 'scenes/shelf/models/1';
export const views = ['a.jpg', 'b.jpg', 'c.jpg', 'd.jpg', 'e.jpg'];
/** A mask of one pixel, the first. */
export const onePixel = { width: 2, height: 2, counts: '013' };
/** A mask of two pixels, the first row. */
export const firstRow = { width: 2, height: 2, counts: '01100' };

export function maskIn(view: string, rle = onePixel, area = 1n) {
  return { view, mask: { case: 'rle', value: rle } as const, area, score: 0.9 };
}

/** Returns an answer of SegmentViews with masks of the views. */
export function answerIn(...named: string[]) {
  const masks = named.map((view) => maskIn(view));
  return { masks, scaleQuantile: 0.4, scaleUnits: 1, threshold: 0.7 };
}

export interface FakeSession {
  readonly session: SceneSession;
  /** Answers the newest request of the stream. */
  readonly answer: (...named: string[]) => void;
  /** Answers it with these masks. */
  readonly answerWith: (masks: readonly object[], used?: Used) => void;
  /** Refuses it. */
  readonly refuse: (error: unknown) => void;
  /** The requests of the stream. */
  readonly asked: readonly SegmentViewsRequest[];
  /** Those of them that are previews of a click. */
  readonly previews: readonly AskedPreview[];
}

export interface AskedPreview {
  readonly request: SegmentViewsRequest;
  readonly answer: (masks: readonly object[]) => void;
  readonly refuse: () => void;
}

/** Scale and threshold of an answer. */
interface Used {
  readonly scaleQuantile: number;
  readonly threshold: number;
}

type Ask = SegmentSocket['ask'];

/** The session listens to the page's network: a test sets `window` before. */
export async function fakeSession(): Promise<FakeSession> {
  const { SceneSession } = await import('../../app/scene/session');
  const session = new SceneSession(model, views);
  const asked: SegmentViewsRequest[] = [];
  const inside = session as unknown as {
    socket: { ask: Ask; close: () => void };
    take: (sequence: bigint, response: object) => void;
    refused: (sequence: bigint, error: unknown) => void;
  };
  const previews: AskedPreview[] = [];
  const ask: Ask = (request, taker) => {
    const sequence = BigInt(asked.push(request));
    if (!taker) return sequence;
    previews.push({
      request,
      answer: (masks) => taker.answered(sequence, { ...answerIn(), masks } as never),
      refuse: () => taker.refused(sequence, undefined),
    });
    return sequence;
  };
  inside.socket = { ask, close: () => undefined };
  session.show('a.jpg');
  const newest = () => BigInt(asked.length);
  return {
    session,
    asked,
    previews,
    answer: (...named) => inside.take(newest(), answerIn(...named)),
    answerWith: (masks, used) => inside.take(newest(), { ...answerIn(), masks, ...used }),
    refuse: (error) => inside.refused(newest(), error),
  };
}

/** Replaces methods of a client, and returns a function that puts them back. */
export function replace<T extends object>(client: T, methods: Record<string, unknown>): () => void {
  const changed = client as Record<string, unknown>;
  const before = Object.keys(methods).map((name) => [name, changed[name]] as const);
  Object.assign(changed, methods);
  return () => Object.assign(changed, Object.fromEntries(before));
}
