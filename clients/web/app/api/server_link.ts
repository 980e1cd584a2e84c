// Whether the server answers. Requests that fail because it does not are repeated with growing pauses
// until it does, so that the page recovers by itself. Requests to a job that has no state to ask yet are
// repeated, too, after the pause that the server names.
import { Store } from '../store';
import { failureOf, isCancelled } from './failure';

export interface ServerLink {
  readonly away: boolean;
  readonly what: string;
  /** Time of the next try, as of Date.now(). */
  readonly nextTry: number;
}

export const serverLink = new Store<ServerLink>({ away: false, what: '', nextTry: 0 });

const firstPauseMs = 500;
const longestPauseMs = 8000;
const impatient = new Set<() => void>();

/** Ends the pauses: the person does not want to wait. */
export function tryNow(): void {
  for (const wake of [...impatient]) wake();
}

window.addEventListener('online', tryNow);

function pause(milliseconds: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const done = () => {
      clearTimeout(timer);
      impatient.delete(done);
      signal?.removeEventListener('abort', done);
      resolve();
    };
    const timer = setTimeout(done, milliseconds);
    impatient.add(done);
    signal?.addEventListener('abort', done);
  });
}

export function serverAnswers(): void {
  if (serverLink.get().away) serverLink.set({ away: false, what: '', nextTry: 0 });
}

/** Pauses before the next try to reach a server that is away. */
export class Backoff {
  private pauseMs = firstPauseMs;

  reset(): void {
    this.pauseMs = firstPauseMs;
    serverAnswers();
  }

  async wait(what: string, retryMs: number | undefined, signal?: AbortSignal): Promise<void> {
    // A random part, so that not all pages try at the same moment.
    const milliseconds = Math.max(retryMs ?? 0, this.pauseMs * (0.8 + 0.4 * Math.random()));
    this.pauseMs = Math.min(2 * this.pauseMs, longestPauseMs);
    serverLink.set({ away: true, what, nextTry: Date.now() + milliseconds });
    await pause(milliseconds, signal);
  }
}

/** Repeats a call until the server answers. Throws the answer if it is an error. */
export async function steadily<T>(ask: () => Promise<T>, signal?: AbortSignal): Promise<T> {
  const backoff = new Backoff();
  for (;;) {
    try {
      const answer = await ask();
      serverAnswers();
      return answer;
    } catch (error) {
      if (signal?.aborted || isCancelled(error)) throw error;
      const failure = failureOf(error);
      if (!failure.away) serverAnswers();
      if (!failure.away && !failure.isEarly) throw error;
      if (failure.away) await backoff.wait(failure.what, failure.retryMs, signal);
      else await pause(failure.retryMs ?? firstPauseMs, signal);
      if (signal?.aborted) throw error;
    }
  }
}
