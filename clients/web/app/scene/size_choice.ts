// The size that is chosen along the ladder of a prompt's masks.
import type { Store } from '../store';
import type { Mask, Proposal } from './answer';
import { agreesWith } from './extend_prompt';
import { ladderOf } from './ladder';
import type { Granularity, Prompt } from './prompt';
import type { Found, SessionState } from './session_state';
import { isForSam, isOpen } from './session_state';

/** The session in which a size is chosen. */
export interface Sizable {
  readonly state: Store<SessionState>;
  shown(): string;
  soFar(): Found;
  /** Changes what was found so far. */
  find(found: Partial<Found>): void;
  /** Keeps the state for undo. */
  remember(): void;
  /** Answers that are still to come belong to what was shown before. */
  outdate(): void;
  /** Asks for masks of these views. */
  ask(views: readonly string[]): void;
}

export class SizeChoice {
  /** Whether the size slider is being moved: all of that is one step for undo. */
  private climbing = false;
  /** Granularities that were chosen by the size slider. */
  private readonly snapped = new WeakSet<Granularity>();

  constructor(private readonly session: Sizable) {}

  /**
   * Shows a rung of the ladder. In the prompt's view its mask is there already; another shown view
   * follows at once, the rest of them when the slider rests.
   */
  climb(index: number): void {
    const { session } = this;
    const { prompt, answer, ladder } = session.state.get();
    const rung = ladder.rungs[index];
    if (!prompt || !answer || !rung || !ladder.isCurrent || index === ladder.at) return;
    if (!this.climbing) session.remember();
    this.climbing = true;
    session.outdate();
    const { granularity, scale, threshold, mask } = rung;
    if (!isOpen(granularity)) this.snapped.add(granularity);
    session.state.patch({
      granularity,
      answer: { ...answer, scale, threshold, masks: new Map([...answer.masks, [mask.view, mask]]) },
      ladder: { ...ladder, at: index },
      busy: false,
      looking: false,
      current: new Set([mask.view]),
    });
    const kept = isForSam(session.state.get()) ? ([[mask.view, mask]] as const) : [];
    session.find({ kept: new Map(kept) });
    if (session.shown() !== mask.view) session.ask([session.shown()]);
  }

  /** The slider rests, or the prompt changes: the next move is another step for undo. */
  rest(): void {
    this.climbing = false;
  }

  /** Returns whether the size that was chosen does not fit the newest mark. */
  isMisfit(prompt: Prompt, granularity: Granularity, own: Mask | undefined): boolean {
    return !!own && this.snapped.has(granularity) && !agreesWith(own.rle, prompt);
  }

  /** Takes the answer in the prompt's view as one of the sizes. */
  takeAnswer(mask: Mask | undefined): void {
    const { session } = this;
    const { granularity, answer } = session.state.get();
    if (!mask || !answer) return;
    const { scale, threshold } = answer;
    session.find({ answered: { granularity, scale, threshold, mask } });
    this.putLadder();
  }

  takeProposals(proposals: readonly Proposal[] | undefined): void {
    this.session.find({ proposals });
    this.putLadder();
  }

  private putLadder(): void {
    const { proposals, answered } = this.session.soFar();
    if (proposals) this.session.state.patch({ ladder: ladderOf(proposals, answered) });
  }
}
