// The state of a session that the screen shows.
import type { Failure } from '../api/failure';
import type { Answer, Proposal } from './answer';
import type { Miss } from './miss';
import type { Granularity, Prompt } from './prompt';

export interface SessionState {
  readonly prompt: Prompt | undefined;
  readonly granularity: Granularity;
  readonly answer: Answer | undefined;
  readonly proposals: readonly Proposal[];
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
  readonly canUndo: boolean;
}

export const nothingAsked: SessionState = {
  prompt: undefined,
  granularity: {},
  answer: undefined,
  proposals: [],
  busy: false,
  looking: false,
  current: new Set(),
  failure: undefined,
  miss: undefined,
  numAnswers: 0,
  canUndo: false,
};

/** What a prompt that hits nothing gives back. */
export type Before = Pick<
  SessionState,
  'prompt' | 'granularity' | 'answer' | 'current' | 'proposals'
>;
