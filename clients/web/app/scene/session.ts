// The state of segmenting a scene: the current prompt, the server's answers to it, and what was
// made from them. It does not depend on the screen.
import type { SegmentViewsResponse } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { segmentation } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { SegmentSocket } from '../api/segment_socket';
import { steadily } from '../api/server_link';
import { Store } from '../store';
import type { Answer, Proposal } from './answer';
import { answerOf, proposalsOf } from './answer';
import type { Box, Granularity, Place, Point, Prompt } from './prompt';
import { placeOf, promptOf, samePlace, segmentRequest } from './prompt';

/** A click, or the middle of a box, that hit nothing: pixels of its view. */
export interface Miss {
  readonly place: Place;
  readonly x: number;
  readonly y: number;
}

export function isMiss(failure: Failure): boolean {
  return failure.reason === 'NOTHING_THERE';
}

/** Returns the position of a prompt that got no answer. */
export function missOf(prompt: Prompt): Miss | undefined {
  if (prompt.kind === 'label') return undefined;
  const { place } = prompt;
  if (prompt.kind === 'box') {
    const { x, y, width, height } = prompt.box;
    return { place, x: x + width / 2, y: y + height / 2 };
  }
  const last = prompt.points.at(-1);
  return last && { place, x: last.x, y: last.y };
}

export interface SessionState {
  readonly prompt: Prompt | undefined;
  readonly granularity: Granularity;
  readonly answer: Answer | undefined;
  readonly proposals: readonly Proposal[];
  readonly busy: boolean;
  readonly failure: Failure | undefined;
  /** Set if the newest prompt hit nothing; the answer before it is shown. */
  readonly miss: Miss | undefined;
  /** Number of the stream's answers shown since the page was opened. */
  readonly numAnswers: number;
  readonly canUndo: boolean;
}

const nothing: SessionState = {
  prompt: undefined,
  granularity: {},
  answer: undefined,
  proposals: [],
  busy: false,
  failure: undefined,
  miss: undefined,
  numAnswers: 0,
  canUndo: false,
};

/** Milliseconds without another request after which all views are requested. */
const settleMs = 180;
const maxPoints = 64;

export class SceneSession {
  readonly state = new Store<SessionState>(nothing);
  private readonly past: Pick<SessionState, 'prompt' | 'granularity'>[] = [];
  private readonly socket = new SegmentSocket({
    answered: (sequence, answer) => this.take(sequence, answer),
    refused: (sequence, error) => this.refused(sequence, error),
  });
  /** Answers to requests before this one belong to an earlier prompt. */
  private firstSequence = 0n;
  private newestSequence = 0n;
  /** The state before the newest prompt, until that is answered. */
  private before: Pick<SessionState, 'prompt' | 'granularity' | 'answer' | 'proposals'> | undefined;
  private settling: ReturnType<typeof setTimeout> | undefined;
  private elsewhere = new AbortController();
  /** Ends a call of placeBorder. */
  private placing = new AbortController();
  /** Masks of the answer whose borders SAM has placed, by view. */
  private placed: Answer['masks'] = new Map();
  private shownView = '';

  constructor(readonly model: string) {}

  /** The shown view, which is requested together with the prompt's view. */
  show(view: string): void {
    this.shownView = view;
    const { prompt, answer } = this.state.get();
    if (prompt && !answer?.masks.has(view)) this.askOtherViews();
  }

  addPoint(place: Place, point: Point): void {
    const { prompt } = this.state.get();
    const goesOn = prompt?.kind === 'points' && samePlace(placeOf(prompt), place);
    const points = goesOn ? [...prompt.points, point] : [point];
    if (points.every(({ negative }) => negative)) {
      this.fail('Nothing is included yet.', 'Click what is meant first, then what is not.');
    } else if (points.length > maxPoints) {
      this.fail(`A prompt has at most ${maxPoints} points.`, 'Clear it and start again.');
    } else {
      this.pose({ kind: 'points', place, points });
    }
  }

  setBox(place: Place, box: Box): void {
    this.pose({ kind: 'box', place, box });
  }

  askLabel(label: string): void {
    this.pose({ kind: 'label', label });
  }

  /**
   * Called while a slider moves. The other value stays that of the answer, so that only the dragged
   * one changes and the server need not search for the best of both (3 ms instead of 40).
   */
  drag(change: Granularity): void {
    if (!this.state.get().prompt) return;
    this.state.patch({ granularity: { ...this.fixedGranularity(), ...change } });
    clearTimeout(this.settling);
    this.elsewhere.abort();
    this.send(false);
  }

  /** The slider was released: all views follow. */
  rest(): void {
    if (this.state.get().prompt) this.askOtherViews();
  }

  choose({ scale, threshold }: Proposal): void {
    this.remember();
    this.state.patch({ granularity: { scale, threshold } });
    this.send();
  }

  /** Lets SAM place the border of the shown mask, at the scale and threshold of the answer. */
  async placeBorder(): Promise<void> {
    const { prompt, answer, busy } = this.state.get();
    if (!prompt || !answer || busy) return;
    const place = placeOf(prompt);
    const views = place && 'camera' in place ? undefined : [this.shownView].filter(Boolean);
    const request = segmentRequest(this.model, prompt, this.fixedGranularity(), views);
    this.forgetBorders();
    const { signal } = this.placing;
    this.state.patch({ busy: true, failure: undefined });
    try {
      const { masks } = answerOf(
        await segmentation.segmentViews({ ...request, samBorders: true }, { signal }),
      );
      if (signal.aborted) return;
      this.placed = masks;
      const all = new Map([...(this.state.get().answer ?? answer).masks, ...masks]);
      this.state.patch({ answer: { ...answer, masks: all }, busy: false });
    } catch (error) {
      // Whatever ended it has set `busy` for itself.
      if (signal.aborted || isCancelled(error)) return;
      this.state.patch({ busy: false, failure: failureOf(error) });
    }
  }

  undo(): void {
    const before = this.past.pop();
    if (!before) return;
    this.forgetAnswers();
    this.state.patch({ ...before, canUndo: this.past.length > 0 });
    if (before.prompt) this.send();
  }

  clear(): void {
    if (this.state.get().prompt) this.remember();
    this.forgetAnswers();
    this.state.patch({ prompt: undefined, granularity: {} });
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined, miss: undefined });
  }

  end(): void {
    clearTimeout(this.settling);
    this.elsewhere.abort();
    this.placing.abort();
    this.socket.close();
  }

  /** The scale and threshold that are set, else those of the answer. */
  private fixedGranularity(): Granularity {
    const { granularity, answer } = this.state.get();
    return {
      scale: granularity.scale ?? answer?.scale,
      threshold: granularity.threshold ?? answer?.threshold,
    };
  }

  private fail(what: string, todo: string): void {
    const { code, ...rest } = failureOf(new Error(what));
    this.state.patch({ failure: { ...rest, code, what, todo } });
  }

  private remember(): void {
    const { prompt, granularity } = this.state.get();
    this.past.push({ prompt, granularity });
    this.state.patch({ canUndo: true });
  }

  private forgetBorders(): void {
    this.placing.abort();
    this.placing = new AbortController();
    this.placed = new Map();
  }

  private forgetAnswers(): void {
    this.forgetBorders();
    this.firstSequence = this.newestSequence + 1n;
    clearTimeout(this.settling);
    this.elsewhere.abort();
    this.before = undefined;
    this.state.patch({
      answer: undefined,
      proposals: [],
      failure: undefined,
      miss: undefined,
      busy: false,
    });
  }

  private pose(prompt: Prompt): void {
    this.remember();
    const { prompt: asked, granularity, answer, proposals } = this.state.get();
    // If two prompts in a row get no answer, there is no earlier state to return to.
    const before =
      asked && !answer ? this.before : { prompt: asked, granularity, answer, proposals };
    this.forgetAnswers();
    this.before = before;
    // For another thing scale and threshold are chosen again.
    const old = this.state.get().prompt;
    const same = old?.kind === 'points' && prompt.kind === 'points' && prompt.points.length > 1;
    this.state.patch({ prompt, granularity: same ? this.state.get().granularity : {} });
    this.send();
  }

  private send(andOtherViews = true): void {
    const { prompt, granularity } = this.state.get();
    if (!prompt) return;
    const place = placeOf(prompt);
    const own = place && 'view' in place ? place.view : '';
    const views =
      place && 'camera' in place ? undefined : [...new Set([own, this.shownView])].filter(Boolean);
    this.forgetBorders();
    this.state.patch({ busy: true });
    this.newestSequence = this.socket.ask(segmentRequest(this.model, prompt, granularity, views));
    if (andOtherViews) this.askOtherViews();
  }

  private take(sequence: bigint, response: SegmentViewsResponse): void {
    if (sequence < this.firstSequence) return;
    this.before = undefined;
    const answer = answerOf(response);
    const { answer: before, numAnswers } = this.state.get();
    // Masks of other views follow when the slider stops.
    const masks = new Map([...(before?.masks ?? []), ...answer.masks]);
    this.state.patch({
      answer: { ...answer, masks },
      busy: sequence !== this.newestSequence,
      numAnswers: numAnswers + 1,
      failure: undefined,
    });
  }

  private refused(sequence: bigint, error: unknown): void {
    if (sequence < this.firstSequence) return;
    const failure = failureOf(error);
    const { prompt } = this.state.get();
    const miss = prompt && isMiss(failure) ? missOf(prompt) : undefined;
    if (miss && this.before) this.goBack(miss);
    else this.state.patch({ busy: false, failure });
  }

  /** Takes back the newest prompt: the answer before it stays. */
  private goBack(miss: Miss): void {
    const before = this.before;
    this.past.pop();
    this.forgetAnswers();
    this.state.patch({ ...before, miss, canUndo: this.past.length > 0 });
    if (before?.prompt) this.askOtherViews();
  }

  private askOtherViews(): void {
    clearTimeout(this.settling);
    this.elsewhere.abort();
    this.settling = setTimeout(() => void this.settle(), settleMs);
  }

  /** Requests all views at the scale and threshold of the answer, and the proposals. */
  private async settle(): Promise<void> {
    const { prompt, proposals, busy } = this.state.get();
    if (!prompt) return;
    if (busy) return this.askOtherViews();
    this.elsewhere = new AbortController();
    const { signal } = this.elsewhere;
    const fixed = this.fixedGranularity();
    try {
      if (prompt.kind === 'points' && proposals.length === 0) {
        const request = { model: this.model, prompt: promptOf(prompt), maxProposals: 5 };
        const answer = await steadily(
          () => segmentation.proposeScales(request, { signal }),
          signal,
        );
        if (!signal.aborted) this.state.patch({ proposals: proposalsOf(answer) });
      }
      const request = segmentRequest(this.model, prompt, fixed, 'all');
      const all = answerOf(await steadily(() => segmentation.segmentViews(request, { signal }), signal));
      if (signal.aborted) return;
      const own = this.state.get().answer;
      const masks = new Map([...(own?.masks ?? []), ...all.masks, ...this.placed]);
      this.state.patch({ answer: own ? { ...own, masks } : { ...all, masks } });
    } catch (error) {
      if (!signal.aborted && !isCancelled(error)) this.state.patch({ failure: failureOf(error) });
    }
  }
}
