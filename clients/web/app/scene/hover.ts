// The preview of a click: what it would give, while the pointer is over the photograph. Its requests go
// through the session's stream, one at a time: while one is computed, the newest position waits. A request
// of the session ends them, and none is made while the session waits for an answer of its own.
import type { SegmentViewsResponse } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { recall, remember } from '../remembered';
import { Store } from '../store';
import type { Mask } from './answer';
import { answerOf } from './answer';
import type { Granularity, Place, Point, Prompt } from './prompt';
import type { SessionState } from './session_state';

/** What a click would ask. */
export interface Intent {
  readonly prompt: Prompt;
  readonly granularity: Granularity;
}

/** What a click would ask, and the answer to it. */
export interface Preview extends Intent {
  readonly response: SegmentViewsResponse;
}

/** The session in which somebody may click. */
export interface Clickable {
  readonly state: Store<SessionState>;
  /** Returns what a click would ask; undefined if it would be refused. */
  intentOf(place: Place, point: Point): Intent | undefined;
  /** Returns whether the size that was chosen does not fit the answer: the server then chooses again. */
  isMisfit(intent: Intent, own: Mask | undefined): boolean;
  /** Asks the stream for the mask in the view. A request of the session may take its place. */
  preview(
    intent: Intent,
    view: string,
    answered: (response: SegmentViewsResponse) => void,
    refused: () => void,
  ): void;
}

export interface HoverState {
  readonly isOn: boolean;
  /** The answer that a click would get; undefined while there is no answer, or nothing is there. */
  readonly mask: Mask | undefined;
  /** The pixel for which that is, "x,y"; empty: none. */
  readonly at: string;
  /** Whether an answer takes over `lateMs`. */
  readonly isLate: boolean;
}

/** A pixel of a view. */
interface Target {
  readonly view: string;
  readonly point: Point;
}

const storedName = 'pepeseg-preview';
const nothingShown = { mask: undefined, at: '', isLate: false } as const;
/** Milliseconds after which an answer is late. */
const lateMs = 300;

/** Returns the pixel under a position: its middle, which all positions in it share. */
function targetOf(view: string, { x, y, negative }: Point): Target {
  return { view, point: { x: Math.floor(x) + 0.5, y: Math.floor(y) + 0.5, negative } };
}

function sameTarget(a: Target | undefined, b: Target | undefined): boolean {
  if (!a || !b || a.view !== b.view) return false;
  return a.point.x === b.point.x && a.point.y === b.point.y && a.point.negative === b.point.negative;
}

export class ClickPreview {
  readonly state = new Store<HoverState>({ isOn: recall(storedName) !== 'off', ...nothingShown });
  /** Where the pointer is. */
  private wanted: Target | undefined;
  /** The target of the request that is computed. */
  private asked: Target | undefined;
  /** The newest target that was answered, and its answer; without one nothing is there. */
  private answered: { readonly target: Target; readonly preview: Preview | undefined } | undefined;
  private waiting: ReturnType<typeof setTimeout> | undefined;
  /** Whether a button is held. */
  private isHeld = false;
  /** The newest click: the pointer leaves its surroundings before there is another preview. */
  private clicked: Target | undefined;
  /** What the answers build on; other prompts and sizes make them outdated. */
  private base: Pick<SessionState, 'prompt' | 'granularity'>;

  constructor(private readonly session: Clickable) {
    this.base = session.state.get();
    session.state.follow(() => this.follow());
  }

  turn(isOn: boolean): void {
    this.leave();
    remember(storedName, isOn ? 'on' : 'off');
    this.state.patch({ isOn });
  }

  /**
   * The pointer moved, and no button is held. `slack`: distance from the newest click, pixels, up to which
   * the pointer still rests.
   */
  move(view: string, point: Point, slack: number): void {
    if (!this.state.get().isOn) return;
    const { clicked } = this;
    const rests =
      clicked?.view === view &&
      Math.hypot(point.x - clicked.point.x, point.y - clicked.point.y) < slack;
    if (rests) return;
    this.clicked = undefined;
    this.isHeld = false;
    this.wanted = targetOf(view, point);
    this.ask();
  }

  /** A button was pressed: what is shown stays, and nothing more is asked. */
  hold(): void {
    this.isHeld = true;
  }

  /** The pointer left, drags, or means something else. */
  leave(): void {
    this.clicked = undefined;
    this.reset();
  }

  /** Ends the preview by a click. Returns what the click asks, and its answer, if that is the one shown. */
  click(place: Place, point: Point): Preview | undefined {
    const target = targetOf('view' in place ? place.view : '', point);
    const { answered } = this;
    this.reset();
    this.clicked = target;
    return sameTarget(answered?.target, target) ? answered?.preview : undefined;
  }

  /** Ends the request that is computed, and hides the preview. */
  reset(): void {
    this.wanted = undefined;
    this.asked = undefined;
    this.answered = undefined;
    this.isHeld = false;
    clearTimeout(this.waiting);
    const { at, isLate } = this.state.get();
    if (at !== '' || isLate) this.state.patch(nothingShown);
  }

  private follow(): void {
    const { prompt, granularity } = this.session.state.get();
    const isSame = prompt === this.base.prompt && granularity === this.base.granularity;
    this.base = { prompt, granularity };
    if (isSame) this.ask();
    else this.reset();
  }

  private ask(): void {
    const { wanted } = this;
    if (!wanted || this.asked || this.isHeld || this.session.state.get().busy) return;
    if (sameTarget(wanted, this.answered?.target)) return;
    const intent = this.session.intentOf({ view: wanted.view }, wanted.point);
    if (intent) this.request(wanted, intent);
    else this.take(wanted, undefined);
  }

  private request(target: Target, intent: Intent): void {
    this.asked = target;
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.state.patch({ isLate: true }), lateMs);
    this.session.preview(
      intent,
      target.view,
      (response) => {
        if (this.asked !== target) return;
        const own = answerOf(response).masks.get(target.view);
        const open = { prompt: intent.prompt, granularity: {} };
        if (this.session.isMisfit(intent, own)) this.request(target, open);
        else this.take(target, { ...intent, response });
      },
      () => {
        if (this.asked === target) this.take(target, undefined);
      },
    );
  }

  private take(target: Target, preview: Preview | undefined): void {
    this.asked = undefined;
    this.answered = { target, preview };
    clearTimeout(this.waiting);
    const mask = preview && answerOf(preview.response).masks.get(target.view);
    const at = `${target.point.x - 0.5},${target.point.y - 0.5}`;
    this.state.patch({ mask, at, isLate: false });
    this.ask();
  }
}
