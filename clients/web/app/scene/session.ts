// The state of segmenting a scene: the current prompt, the server's answers to it, and what was
// made from them. It does not depend on the screen.
import type { SegmentViewsResponse } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { failureOf, isCancelled } from '../api/failure';
import { SegmentSocket } from '../api/segment_socket';
import { Store } from '../store';
import { acceptedMask } from './accepted_mask';
import type { Answer, Mask } from './answer';
import { answerOf } from './answer';
import type { Refusal } from './extend_prompt';
import { agreesWith, isExtended, isRefusal, withPoint, withStroke } from './extend_prompt';
import { ladderOf, noLadder } from './ladder';
import type { Miss } from './miss';
import { isMiss, missOf } from './miss';
import { OtherViews } from './other_views';
import type { Granularity, Place, Point, Prompt, Stroke } from './prompt';
import { isIn3d, ownViewOf, segmentRequest } from './prompt';
import type { SamClicks } from './segment_views';
import { segmentViews } from './segment_views';
import type { Before, Found, SessionState } from './session_state';
import {
  beforeOf,
  granularityElsewhere,
  isForSam,
  isOpen,
  nothingAnswered,
  nothingAsked,
  nothingFound,
  usedGranularity,
} from './session_state';

export class SceneSession {
  readonly state = new Store<SessionState>(nothingAsked);
  private readonly others: OtherViews;
  private readonly past: Pick<SessionState, 'prompt' | 'granularity'>[] = [];
  private readonly socket = new SegmentSocket({
    answered: (sequence, answer) => this.take(sequence, answer),
    refused: (sequence, error) => this.refused(sequence, error),
  });
  /** Answers to requests before this one belong to an earlier prompt. */
  private firstSequence = 0n;
  private newestSequence = 0n;
  /** The state before the newest prompt, until that is answered. */
  private before: { readonly state: Before; readonly found: Found } | undefined;
  /** Ends the requests for masks that are kept. */
  private keeping = new AbortController();
  private found = nothingFound;
  /** Whether the size slider is being moved: all of that is one step for undo. */
  private climbing = false;
  /** Granularities that were chosen by the size slider. */
  private readonly snapped = new WeakSet<Granularity>();
  private shownView = '';

  /** `views`: names of the model's views, in their order. */
  constructor(
    readonly model: string,
    readonly views: readonly string[],
  ) {
    this.others = new OtherViews({
      model,
      views,
      state: this.state,
      shown: () => this.shownView,
      soFar: () => this.found,
      report: (error, signal) => this.report(error, signal),
      takeMasks: (masks, bySam) => this.takeMasks(masks, bySam),
      takeProposals: (proposals) => {
        this.found = { ...this.found, proposals };
        this.putLadder();
      },
    });
  }

  /** The shown view, which is requested together with the prompt's view. */
  show(view: string): void {
    this.shownView = view;
    const { prompt, current } = this.state.get();
    if (prompt && !current.has(view)) this.others.ask();
  }

  addPoint(place: Place, point: Point): void {
    this.extend(withPoint(this.state.get().prompt, place, point));
  }

  addStroke(place: Place, stroke: Stroke): void {
    this.extend(withStroke(this.state.get().prompt, place, stroke));
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
    this.climbing = false;
    if (this.state.get().prompt) this.others.ask();
  }

  /**
   * Shows a rung of the ladder. In the prompt's view its mask is there already; another shown view
   * follows at once, the rest of them with rest().
   */
  climb(index: number): void {
    const { prompt, answer, ladder } = this.state.get();
    const rung = ladder.rungs[index];
    if (!prompt || !answer || !rung || !ladder.isCurrent || index === ladder.at) return;
    if (!this.climbing) this.remember();
    this.climbing = true;
    this.outdate();
    const { granularity, scale, threshold, mask } = rung;
    if (!isOpen(granularity)) this.snapped.add(granularity);
    this.state.patch({
      granularity,
      answer: { ...answer, scale, threshold, masks: new Map([...answer.masks, [mask.view, mask]]) },
      ladder: { ...ladder, at: index },
      busy: false,
      looking: false,
      current: new Set([mask.view]),
    });
    const kept = isForSam(this.state.get()) ? ([[mask.view, mask]] as const) : [];
    this.found = { ...this.found, kept: new Map(kept) };
    if (this.shownView !== mask.view) this.ask([this.shownView]);
  }

  /** Chooses whether SAM and the model answer clicks together. */
  setSamClicks(samClicks: SamClicks): void {
    const before = this.state.get();
    this.state.patch({ samClicks });
    const isAsked = isForSam(before) || isForSam(this.state.get());
    if (before.answer && isAsked && before.samClicks !== samClicks) this.send();
  }

  /** Lets SAM place the border of the shown mask, at the scale and threshold of the answer. */
  async placeBorder(): Promise<void> {
    const { prompt, answer, busy } = this.state.get();
    if (!prompt || !answer || busy) return;
    const granularity = granularityElsewhere(this.state.get());
    const views = isIn3d(prompt) ? undefined : [this.shownView].filter(Boolean);
    const query = { model: this.model, prompt, granularity, views, samBorders: true };
    const { signal } = this.keeping;
    this.state.patch({ busy: true, failure: undefined });
    try {
      const { masks } = await segmentViews(query, signal);
      if (!signal.aborted) this.keep(masks);
    } catch (error) {
      this.report(error, signal);
    }
    // Whatever ended it has set `busy` for itself.
    if (!signal.aborted) this.state.patch({ busy: false });
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
    this.endRequests();
    this.socket.close();
  }

  private extend(extended: Prompt | Refusal): void {
    if (!isRefusal(extended)) return this.pose(extended);
    this.state.patch({ failure: { ...failureOf(new Error(extended.what)), ...extended } });
  }

  private remember(): void {
    const { prompt, granularity } = this.state.get();
    this.past.push({ prompt, granularity });
    this.state.patch({ canUndo: true });
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
    this.keeping.abort();
    this.keeping = new AbortController();
  }

  /** Takes the answer in the prompt's view as one of the sizes. */
  private takeSize(mask: Mask | undefined): void {
    const { granularity, answer } = this.state.get();
    if (!mask || !answer) return;
    const { scale, threshold } = answer;
    this.found = { ...this.found, answered: { granularity, scale, threshold, mask } };
    this.putLadder();
  }

  private takeMasks(masks: Answer['masks'], bySam: boolean): void {
    const { prompt } = this.state.get();
    if (!bySam) return this.merge(masks);
    this.keep(masks);
    if (prompt) this.takeSize(masks.get(ownViewOf(prompt)));
  }

  private putLadder(): void {
    const { proposals, answered } = this.found;
    if (proposals) this.state.patch({ ladder: ladderOf(proposals, answered) });
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
    this.climbing = false;
    this.before = undefined;
    this.state.patch(nothingAnswered);
  }

  /** Asks for what a prompt means. `chosen`: its scale and threshold, if it begins. */
  pose(prompt: Prompt, chosen: Granularity = {}): void {
    this.remember();
    const { prompt: asked, granularity, answer, ladder } = this.state.get();
    const earlier = { state: beforeOf(this.state.get()), found: this.found };
    // If two prompts in a row get no answer, the state before both is the earlier one.
    const before = !asked || (answer && !this.before) ? earlier : this.before;
    this.forgetAnswers();
    this.before = before;
    const same = isExtended(asked, prompt);
    this.state.patch({
      prompt,
      granularity: same ? granularity : chosen,
      // The mask so far is shown until the next one comes.
      answer: same ? answer : undefined,
      ladder: same ? { ...ladder, isCurrent: false } : noLadder,
    });
    this.send();
  }

  private send(andOtherViews = true): void {
    const { prompt, granularity } = this.state.get();
    if (!prompt) return;
    this.endRequests();
    this.found = { ...this.found, kept: new Map() };
    this.state.patch({ current: new Set() });
    const named = [...new Set([ownViewOf(prompt), this.shownView])].filter(Boolean);
    this.ask(isIn3d(prompt) ? undefined : named);
    if (prompt.kind === 'label' && isOpen(granularity)) void this.keepAccepted(prompt.label);
    if (andOtherViews) this.others.ask();
  }

  /** Asks the stream for masks of these views; undefined: of the prompt's. */
  private ask(views: readonly string[] | undefined): void {
    const { prompt, granularity, current } = this.state.get();
    if (!prompt) return;
    const left = views === undefined ? [] : [...current].filter((view) => !views.includes(view));
    this.state.patch({ busy: true, looking: false, current: new Set(left) });
    this.newestSequence = this.socket.ask(segmentRequest(this.model, prompt, granularity, views));
  }

  private take(sequence: bigint, response: SegmentViewsResponse): void {
    if (sequence < this.firstSequence) return;
    this.before = undefined;
    const answer = answerOf(response);
    const { answer: before, numAnswers, prompt, granularity, current } = this.state.get();
    const own = prompt && answer.masks.get(ownViewOf(prompt));
    if (own && prompt && this.snapped.has(granularity) && !agreesWith(own.rle, prompt)) {
      // The size that was chosen does not fit the newest mark: the server chooses again.
      this.state.patch({ granularity: {} });
      return this.send();
    }
    // Masks of other views follow when the slider stops.
    const masks = new Map([...(before?.masks ?? []), ...answer.masks, ...this.found.kept]);
    const isNewest = sequence === this.newestSequence;
    // Until SAM has answered, the model's masks are not the last word.
    const final = isForSam(this.state.get()) ? [] : answer.masks.keys();
    this.state.patch({
      answer: { ...answer, masks },
      busy: !isNewest,
      current: new Set(isNewest ? [...current, ...final, ...this.found.kept.keys()] : []),
      numAnswers: numAnswers + 1,
      failure: undefined,
    });
    this.takeSize(own);
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
    if (before) this.found = before.found;
    this.state.patch({ ...before?.state, miss, canUndo: this.past.length > 0 });
    if (before?.state.prompt) this.others.ask();
  }
}
