// The state of segmenting a scene: the current prompt, the server's answers to it, and what was
// made from them. It does not depend on the screen.
import type { SegmentViewsResponse } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { failureOf, isCancelled } from '../api/failure';
import { SegmentSocket } from '../api/segment_socket';
import type { Change } from '../history';
import { History } from '../history';
import type { Rle } from '../mask/rle';
import { extentOf } from '../mask/rle';
import { Store } from '../store';
import { answerWith, exactMask } from './accepted_mask';
import type { Answer, Mask } from './answer';
import { answerOf } from './answer';
import type { Refusal } from './extend_prompt';
import { isExtended, isRefusal, withPoint, withStroke } from './extend_prompt';
import type { Intent, Preview } from './hover';
import { ClickPreview } from './hover';
import { KeptMasks } from './kept_masks';
import { noLadder } from './ladder';
import type { Miss } from './miss';
import { isMiss, missOf } from './miss';
import { OtherViews } from './other_views';
import type { Granularity, Place, Point, Prompt, Stroke } from './prompt';
import { isEdited, isIn3d, nameOf, ownViewOf, segmentRequest } from './prompt';
import type { SamClicks } from './segment_views';
import type { Asked, Before, Found, SessionState } from './session_state';
import { SizeChoice } from './size_choice';
import {
  askedChange,
  beforeOf,
  isForSam,
  isOpen,
  nothingAnswered,
  nothingAsked,
  nothingFound,
  sizeFor,
  usedGranularity,
} from './session_state';

export class SceneSession {
  readonly state = new Store<SessionState>(nothingAsked);
  /** What a click would give. */
  readonly hover: ClickPreview;
  private readonly others: OtherViews;
  private readonly kept: KeptMasks;
  private readonly sizes: SizeChoice;
  /** The change that the newest prompt is. */
  private posed: Change | undefined;
  private readonly socket = new SegmentSocket({
    answered: (sequence, answer) => this.take(sequence, answer),
    refused: (sequence, error) => this.refused(sequence, error),
  });
  /** Answers to requests before this one belong to an earlier prompt. */
  private firstSequence = 0n;
  private newestSequence = 0n;
  /** The state before the newest prompt, until that is answered. */
  private before: { readonly state: Before; readonly found: Found } | undefined;
  private found: Found = nothingFound;
  private shownView = '';

  /** `views`: names of the model's views, in their order. */
  constructor(
    readonly model: string,
    readonly views: readonly string[],
    readonly history = new History(),
  ) {
    const common = {
      model,
      state: this.state,
      shown: () => this.shownView,
      soFar: () => this.found,
      report: (error: unknown, signal: AbortSignal) => this.report(error, signal),
    };
    this.kept = new KeptMasks({ ...common, keep: (masks) => this.keep(masks) });
    this.sizes = new SizeChoice({
      ...common,
      find: (found) => (this.found = { ...this.found, ...found }),
      remember: () => this.remember('Size'),
      outdate: () => this.outdate(),
      ask: (named) => this.ask(named),
    });
    this.others = new OtherViews({
      ...common,
      views,
      takeMasks: (masks, bySam) => this.takeMasks(masks, bySam),
      takeProposals: (proposals) => this.sizes.takeProposals(proposals),
    });
    this.hover = new ClickPreview({
      state: this.state,
      intentOf: (place, point) => this.intentOf(place, point),
      isMisfit: ({ prompt, granularity }, own) => this.sizes.isMisfit(prompt, granularity, own),
      preview: ({ prompt, granularity }, view, answered, refused) =>
        this.socket.ask(segmentRequest(model, prompt, granularity, [view]), {
          answered: (_, response) => answered(response),
          refused,
        }),
    });
  }

  /** The shown view, which is requested together with the prompt's view. */
  show(view: string): void {
    this.shownView = view;
    this.hover.leave();
    const { prompt, current } = this.state.get();
    if (prompt && !current.has(view)) this.others.ask();
  }

  /** Segments what was clicked; where the pointer has rested, that is answered already. */
  addPoint(place: Place, point: Point): void {
    const preview = this.hover.click(place, point);
    if (preview) this.pose(preview.prompt, {}, preview);
    else this.extend(withPoint(this.state.get().prompt, place, point));
  }

  addStroke(place: Place, stroke: Stroke): void {
    this.extend(withStroke(this.state.get().prompt, place, stroke));
  }

  /** Takes a mask of a view that was changed by hand: there it stays as it is, and the other views follow. */
  edit(view: string, rle: Rle): void {
    const prompt = { kind: 'mask', place: { view }, rle, isExact: true } as const;
    if (extentOf(rle).area > 0) this.pose(prompt);
    else this.clear();
  }

  /**
   * Called while a slider moves. The other value stays that of the answer, so that only the dragged
   * one changes and the server need not search for the best of both (3 ms instead of 40).
   */
  drag(change: Granularity): void {
    if (!this.state.get().prompt) return;
    this.state.patch({ granularity: { ...usedGranularity(this.state.get()), ...change } });
    this.send(false);
  }

  /** A slider was released: all views follow. */
  rest(): void {
    this.sizes.rest();
    if (this.state.get().prompt) this.others.ask();
  }

  /** Shows a rung of the ladder. All views follow with rest(). */
  climb(index: number): void {
    this.sizes.climb(index);
  }

  /** Chooses whether SAM and the model answer clicks together. */
  setSamClicks(samClicks: SamClicks): void {
    const before = this.state.get();
    this.state.patch({ samClicks });
    const isAsked = isForSam(before) || isForSam(this.state.get());
    if (before.answer && isAsked && before.samClicks !== samClicks) this.send();
  }

  /** Lets SAM place the border of the shown mask. */
  placeBorder(): Promise<void> {
    return this.kept.placeBorder();
  }

  /** Returns the change that this is; undefined: nothing was shown. */
  clear(): Change | undefined {
    const change = this.state.get().prompt && this.remember('Clear');
    this.forgetAnswers();
    this.state.patch({ prompt: undefined, granularity: {} });
    return change;
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined, miss: undefined });
  }

  end(): void {
    this.hover.leave();
    this.outdate();
    this.socket.close();
  }

  private extend(extended: Prompt | Refusal): void {
    if (!isRefusal(extended)) return this.pose(extended);
    this.state.patch({ failure: { ...failureOf(new Error(extended.what)), ...extended } });
  }

  /** Adds what comes next to the history. */
  private remember(name: string): Change {
    return this.history.add(askedChange(name, this.state, (asked) => this.restore(asked)));
  }

  private restore(asked: Asked): void {
    this.forgetAnswers();
    this.state.patch(asked);
    if (asked.prompt) this.send();
  }

  /** Puts masks in place of the model's until the prompt, scale or threshold changes. */
  private keep(masks: Answer['masks']): void {
    this.found = { ...this.found, kept: new Map([...this.found.kept, ...masks]) };
    this.merge(masks);
  }

  /** Answers that are still to come belong to what was shown before. */
  private outdate(): void {
    this.firstSequence = this.newestSequence + 1n;
    this.endRequests();
  }

  private endRequests(): void {
    this.others.stop();
    this.kept.stop();
  }

  private takeMasks(masks: Answer['masks'], bySam: boolean): void {
    const { prompt } = this.state.get();
    if (!bySam) return this.merge(masks);
    this.keep(masks);
    if (prompt) this.sizes.takeAnswer(masks.get(ownViewOf(prompt)));
  }

  /** Adds current masks to the answer, if there is one. */
  private merge(found: ReadonlyMap<string, Mask>): void {
    const { answer, current } = this.state.get();
    if (!answer) return;
    this.state.patch({
      answer: { ...answer, masks: new Map([...answer.masks, ...found, ...this.found.kept]) },
      current: new Set([...current, ...found.keys()]),
    });
  }

  private report(error: unknown, signal: AbortSignal): void {
    if (!signal.aborted && !isCancelled(error)) this.state.patch({ failure: failureOf(error) });
  }

  private forgetAnswers(): void {
    this.outdate();
    this.found = nothingFound;
    this.sizes.rest();
    this.before = undefined;
    this.state.patch(nothingAnswered);
  }

  /** Returns what a click would ask; undefined if it would be refused. */
  private intentOf(place: Place, point: Point): Intent | undefined {
    const prompt = withPoint(this.state.get().prompt, place, point);
    return isRefusal(prompt) ? undefined : { prompt, granularity: sizeFor(this.state.get(), prompt, {}) };
  }

  /**
   * Asks for what a prompt means. `chosen`: its scale and threshold, if it begins. `preview`: the answer
   * to it, if that is there.
   */
  pose(prompt: Prompt, chosen: Granularity = {}, preview?: Preview): void {
    this.posed = this.remember(nameOf(prompt));
    const { prompt: asked, answer, ladder } = this.state.get();
    const granularity = preview?.granularity ?? sizeFor(this.state.get(), prompt, chosen);
    const earlier = { state: beforeOf(this.state.get()), found: this.found };
    // If two prompts in a row get no answer, the state before both is the earlier one.
    const before = !asked || (answer && !this.before) ? earlier : this.before;
    this.forgetAnswers();
    this.before = before;
    const same = isExtended(asked, prompt);
    const exact = exactMask(prompt);
    this.state.patch({
      prompt,
      granularity,
      // The mask so far is shown until the next one comes.
      answer: same ? answer : exact && answerWith(exact, isEdited(prompt) ? answer : undefined),
      ladder: same ? { ...ladder, isCurrent: false } : noLadder,
    });
    this.send(true, preview?.response);
  }

  /** Asks for the prompt's view and the shown one. `answered`: what the stream would answer. */
  private send(andOtherViews = true, answered?: SegmentViewsResponse): void {
    const { prompt, granularity } = this.state.get();
    if (!prompt) return;
    this.endRequests();
    this.found = { ...this.found, kept: new Map() };
    this.state.patch({ current: new Set() });
    const named = [...new Set([ownViewOf(prompt), this.shownView])].filter(Boolean);
    if (answered) this.accept(answered, true);
    else this.ask(isIn3d(prompt) ? undefined : named);
    if (isOpen(granularity)) void this.kept.keepAccepted(prompt);
    if (andOtherViews) this.others.ask();
  }

  /** Asks the stream for masks of these views; undefined: of the prompt's. */
  private ask(views: readonly string[] | undefined): void {
    const { prompt, granularity, current } = this.state.get();
    if (!prompt) return;
    const left = views === undefined ? [] : [...current].filter((view) => !views.includes(view));
    this.hover.reset();
    this.state.patch({ busy: true, looking: false, current: new Set(left) });
    this.newestSequence = this.socket.ask(segmentRequest(this.model, prompt, granularity, views));
  }

  private take(sequence: bigint, response: SegmentViewsResponse): void {
    if (sequence >= this.firstSequence) this.accept(response, sequence === this.newestSequence);
  }

  private accept(response: SegmentViewsResponse, isNewest: boolean): void {
    this.before = undefined;
    const answer = answerOf(response);
    const { answer: before, numAnswers, prompt, granularity, current } = this.state.get();
    const own = prompt && answer.masks.get(ownViewOf(prompt));
    if (prompt && this.sizes.isMisfit(prompt, granularity, own)) {
      // The size that was chosen does not fit the newest mark: the server chooses again.
      this.state.patch({ granularity: {} });
      return this.send();
    }
    // Masks of other views follow when the slider stops.
    const masks = new Map([...(before?.masks ?? []), ...answer.masks, ...this.found.kept]);
    // Until SAM has answered, the model's masks are not the last word.
    const final = isForSam(this.state.get()) ? [] : answer.masks.keys();
    this.state.patch({
      answer: { ...answer, masks },
      busy: !isNewest,
      current: new Set(isNewest ? [...current, ...final, ...this.found.kept.keys()] : []),
      numAnswers: numAnswers + 1,
      failure: undefined,
    });
    this.sizes.takeAnswer(own);
  }

  private refused(sequence: bigint, error: unknown): void {
    if (sequence < this.firstSequence) return;
    const failure = failureOf(error);
    if (failure.isEarly) return this.askLater(sequence, failure.retryMs);
    const { prompt } = this.state.get();
    const miss = prompt && isMiss(failure) ? missOf(prompt) : undefined;
    if (miss && this.before) this.goBack(miss);
    else this.state.patch({ busy: false, failure });
  }

  /** Asks again after a pause, unless something else was asked. */
  private askLater(sequence: bigint, pauseMs: number | undefined): void {
    const isNewest = () => sequence >= this.firstSequence && sequence === this.newestSequence;
    setTimeout(() => isNewest() && this.send(), pauseMs);
  }

  /** Takes back the newest prompt: the answer before it stays. */
  private goBack(miss: Miss): void {
    const before = this.before;
    if (this.posed) this.history.drop(this.posed);
    this.forgetAnswers();
    if (before) this.found = before.found;
    this.state.patch({ ...before?.state, miss });
    if (before?.state.prompt) this.others.ask();
  }
}
