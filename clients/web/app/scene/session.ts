// The state of segmenting a scene: the current prompt, the server's answers to it, and what was
// made from them. It does not depend on the screen.
import type { SegmentViewsResponse } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { segmentation } from '../api/clients';
import { failureOf, isCancelled } from '../api/failure';
import { SegmentSocket } from '../api/segment_socket';
import { steadily } from '../api/server_link';
import { Store } from '../store';
import { acceptedMask } from './accepted_mask';
import type { Answer, Mask, Proposal } from './answer';
import { answerOf, proposalsOf } from './answer';
import type { Miss } from './miss';
import { isMiss, missOf } from './miss';
import type { Box, Granularity, Place, Point, Prompt } from './prompt';
import { placeOf, promptOf, samePlace, segmentRequest } from './prompt';
import { batchesOf, segmentViews } from './segment_views';
import type { Before, SessionState } from './session_state';
import { nothingAsked } from './session_state';

/** Milliseconds without another request after which all views are requested. */
const settleMs = 180;
const maxPoints = 64;

export class SceneSession {
  readonly state = new Store<SessionState>(nothingAsked);
  private readonly past: Pick<SessionState, 'prompt' | 'granularity'>[] = [];
  private readonly socket = new SegmentSocket({
    answered: (sequence, answer) => this.take(sequence, answer),
    refused: (sequence, error) => this.refused(sequence, error),
  });
  /** Answers to requests before this one belong to an earlier prompt. */
  private firstSequence = 0n;
  private newestSequence = 0n;
  /** The state before the newest prompt, until that is answered. */
  private before: Before | undefined;
  private settling: ReturnType<typeof setTimeout> | undefined;
  private elsewhere = new AbortController();
  /** Ends the requests for the masks below. */
  private keeping = new AbortController();
  /** Masks that replace the model's: of a named label, or with a border by SAM. */
  private kept: Answer['masks'] = new Map();
  private shownView = '';

  /** `views`: names of the model's views, in their order. */
  constructor(
    readonly model: string,
    readonly views: readonly string[],
  ) {}

  /** The shown view, which is requested together with the prompt's view. */
  show(view: string): void {
    this.shownView = view;
    const { prompt, current } = this.state.get();
    if (prompt && !current.has(view)) this.askOtherViews();
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
    const { signal } = this.keeping;
    this.state.patch({ busy: true, failure: undefined });
    try {
      const { masks } = answerOf(
        await segmentation.segmentViews({ ...request, samBorders: true }, { signal }),
      );
      if (signal.aborted) return;
      this.keep(masks);
      this.state.patch({ busy: false });
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
    this.keeping.abort();
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

  /** Puts masks in place of the model's until the prompt, scale or threshold changes. */
  private keep(masks: Answer['masks']): void {
    this.kept = new Map([...this.kept, ...masks]);
    this.merge(masks);
  }

  private forgetKept(): void {
    this.keeping.abort();
    this.keeping = new AbortController();
    this.kept = new Map();
  }

  /** Gets the mask that a person accepted for a label: in its own view it is the answer. */
  private async keepAccepted(label: string): Promise<void> {
    const { signal } = this.keeping;
    try {
      const mask = await acceptedMask(label, signal);
      if (mask && !signal.aborted) this.keep(new Map([[mask.view, mask]]));
    } catch (error) {
      this.report(error, signal);
    }
  }

  /** Adds current masks to the answer, if there is one. */
  private merge(found: ReadonlyMap<string, Mask>): void {
    const { answer, current } = this.state.get();
    if (!answer) return;
    this.state.patch({
      answer: { ...answer, masks: new Map([...answer.masks, ...found, ...this.kept]) },
      current: new Set([...current, ...found.keys()]),
    });
  }

  private report(error: unknown, signal: AbortSignal): void {
    if (!signal.aborted && !isCancelled(error)) this.state.patch({ failure: failureOf(error) });
  }

  private forgetAnswers(): void {
    this.forgetKept();
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
      looking: false,
      current: new Set(),
    });
  }

  private pose(prompt: Prompt): void {
    this.remember();
    const { prompt: asked, granularity, answer, current, proposals } = this.state.get();
    // If two prompts in a row get no answer, there is no earlier state to return to.
    const before =
      asked && !answer
        ? this.before
        : { prompt: asked, granularity, answer, current, proposals };
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
    this.forgetKept();
    this.state.patch({ busy: true, looking: false, current: new Set() });
    this.newestSequence = this.socket.ask(segmentRequest(this.model, prompt, granularity, views));
    const isOpen = granularity.scale === undefined && granularity.threshold === undefined;
    if (prompt.kind === 'label' && isOpen) void this.keepAccepted(prompt.label);
    if (andOtherViews) this.askOtherViews();
  }

  private take(sequence: bigint, response: SegmentViewsResponse): void {
    if (sequence < this.firstSequence) return;
    this.before = undefined;
    const answer = answerOf(response);
    const { answer: before, numAnswers } = this.state.get();
    // Masks of other views follow when the slider stops.
    const masks = new Map([...(before?.masks ?? []), ...answer.masks, ...this.kept]);
    const isNewest = sequence === this.newestSequence;
    this.state.patch({
      answer: { ...answer, masks },
      busy: !isNewest,
      current: new Set(isNewest ? [...answer.masks.keys(), ...this.kept.keys()] : []),
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
    this.state.patch({ looking: true });
    this.settling = setTimeout(() => void this.settle(), settleMs);
  }

  /** Requests the proposals and, at the scale and threshold of the answer, all other views. */
  private async settle(): Promise<void> {
    const { prompt, answer, busy } = this.state.get();
    if (busy) return this.askOtherViews();
    if (!prompt || !answer) return this.state.patch({ looking: false });
    this.elsewhere = new AbortController();
    const { signal } = this.elsewhere;
    await Promise.all([this.propose(prompt, signal), this.lookElsewhere(prompt, signal)]);
  }

  private async propose(prompt: Prompt, signal: AbortSignal): Promise<void> {
    if (prompt.kind !== 'points' || this.state.get().proposals.length > 0) return;
    const request = { model: this.model, prompt: promptOf(prompt), maxProposals: 5 };
    try {
      const answer = await steadily(() => segmentation.proposeScales(request, { signal }), signal);
      if (!signal.aborted) this.state.patch({ proposals: proposalsOf(answer) });
    } catch (error) {
      this.report(error, signal);
    }
  }

  /** Segments the views whose masks are not current, from the shown one on. */
  private async lookElsewhere(prompt: Prompt, signal: AbortSignal): Promise<void> {
    const granularity = this.fixedGranularity();
    const { current } = this.state.get();
    const from = Math.max(0, this.views.indexOf(this.shownView));
    const inOrder = [...this.views.slice(from), ...this.views.slice(0, from)];
    try {
      for (const views of batchesOf(inOrder.filter((view) => !current.has(view)))) {
        const query = { model: this.model, prompt, granularity, views };
        const { masks } = await segmentViews(query, signal);
        if (signal.aborted) return;
        this.merge(masks);
      }
    } catch (error) {
      this.report(error, signal);
    }
    if (!signal.aborted) this.state.patch({ looking: false });
  }
}
