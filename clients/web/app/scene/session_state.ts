// The state of a session that the screen shows.
import type { Failure } from '../api/failure';
import type { Change } from '../history';
import type { Store } from '../store';
import type { Answer, Proposal } from './answer';
import { isExtended } from './extend_prompt';
import type { Ladder, Rung } from './ladder';
import { noLadder } from './ladder';
import type { Miss } from './miss';
import type { Granularity, Prompt } from './prompt';
import type { SamClicks } from './segment_views';

export interface SessionState {
  readonly prompt: Prompt | undefined;
  readonly granularity: Granularity;
  readonly answer: Answer | undefined;
  /** The sizes that the prompt may mean, and the shown one. */
  readonly ladder: Ladder;
  readonly samClicks: SamClicks;
  readonly busy: boolean;
  /** Whether masks of other views are still to come. */
  readonly looking: boolean;
  /** Views whose masks belong to the prompt, scale and threshold; masks of others are older. */
  readonly current: ReadonlySet<string>;
  readonly failure: Failure | undefined;
  /** Set if the newest prompt hit nothing; the answer before it is shown. */
  readonly miss: Miss | undefined;
  /** Number of the stream's answers shown since the page was opened. */
  readonly numAnswers: number;
}

export const nothingAnswered = {
  answer: undefined,
  ladder: noLadder,
  busy: false,
  looking: false,
  current: new Set<string>(),
  failure: undefined,
  miss: undefined,
} as const;

export const nothingAsked: SessionState = {
  ...nothingAnswered,
  prompt: undefined,
  granularity: {},
  samClicks: 'off',
  numAnswers: 0,
};

/** What a prompt that hits nothing gives back. */
export type Before = Pick<SessionState, 'prompt' | 'granularity' | 'answer' | 'current' | 'ladder'>;

export function beforeOf({ prompt, granularity, answer, current, ladder }: SessionState): Before {
  return { prompt, granularity, answer, current, ladder };
}

/** Returns the size with which a prompt is asked: one that was chosen stays while marks are added. */
export function sizeFor(state: Asked, prompt: Prompt, chosen: Granularity): Granularity {
  return isExtended(state.prompt, prompt) ? state.granularity : chosen;
}

/** Returns the scale and threshold that are set, else those of the answer. */
export function usedGranularity({
  granularity,
  answer,
}: Pick<SessionState, 'granularity' | 'answer'>): Granularity {
  return {
    scale: granularity.scale ?? answer?.scale,
    threshold: granularity.threshold ?? answer?.threshold,
  };
}

/**
 * Returns the scale and threshold with which other views are asked for the same thing. The answer to
 * clicks and boxes may be more than its scale and threshold say: if neither was chosen, the server chooses again.
 */
export function granularityElsewhere(
  state: Pick<SessionState, 'prompt' | 'granularity' | 'answer' | 'samClicks'>,
): Granularity {
  const { prompt, granularity } = state;
  const isClicked = prompt?.kind === 'points' && isOpen(granularity);
  return isClicked || isForSam(state) ? {} : usedGranularity(state);
}

/** What undo gives back: all else follows from it. */
export type Asked = Pick<SessionState, 'prompt' | 'granularity'>;

/** Returns the change from what is asked now to what will be asked when it is undone. */
export function askedChange(
  name: string,
  state: Store<SessionState>,
  restore: (asked: Asked) => void,
): Change {
  const askedNow = () => {
    const { prompt, granularity } = state.get();
    return { prompt, granularity };
  };
  const before = askedNow();
  let after = before;
  return {
    name,
    undo: () => {
      after = askedNow();
      restore(before);
    },
    redo: () => restore(after),
  };
}

/** What the answer is made of, and what the size slider goes along. */
export interface Found {
  /** Masks that replace the model's: of a named label, or by SAM. */
  readonly kept: Answer['masks'];
  /** Undefined: the server has not proposed anything for this prompt yet. */
  readonly proposals: readonly Proposal[] | undefined;
  /** The answer in the prompt's view, before the size slider moved. */
  readonly answered: Rung | undefined;
}

export const nothingFound: Found = { kept: new Map(), proposals: undefined, answered: undefined };

export function isOpen({ scale, threshold }: Granularity): boolean {
  return scale === undefined && threshold === undefined;
}

/** Returns whether SAM is asked: it takes clicks and boxes, and chooses by itself how large the thing is. */
export function isForSam({
  prompt,
  granularity,
  samClicks,
}: Pick<SessionState, 'prompt' | 'granularity' | 'samClicks'>): boolean {
  const isMark = prompt?.kind === 'points' || prompt?.kind === 'box';
  return samClicks !== 'off' && isMark && isOpen(granularity);
}
