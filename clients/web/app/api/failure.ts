// Errors as people read them: what happened, and what to do.
import { Code, ConnectError } from '@connectrpc/connect';
import { detailOf } from '../../contract/error_detail';

export interface Failure {
  readonly what: string;
  /** What to do; empty if the first sentence says it all. */
  readonly todo: string;
  readonly code: Code;
  readonly reason: string;
  readonly resource: string;
  readonly limit: string;
  /** Whether no server answers, so that repeating the call may help. */
  readonly away: boolean;
  /** Whether a job that trains has no state to ask yet, so that repeating the call later helps. */
  readonly isEarly: boolean;
  /** When a repetition makes sense, as the server says. */
  readonly retryMs: number | undefined;
}

/** What happened, where the server speaks of fields of its requests. */
const plainWords: Partial<Record<string, string>> = {
  NO_SAM: 'This server cannot place borders by SAM.',
  NO_SNAPSHOT: 'The training has nothing to click on yet.',
};

const advice: Partial<Record<string, string>> = {
  NO_KEY: 'The app shows the server no key: start it with --key-file, or set PEPESEG_KEY.',
  BAD_KEY: 'The server does not accept the app’s key: ask who runs the server for another one.',
  MISSING_SCOPE: 'The app’s key may not do this: a key with more scopes is needed.',
  NOT_YOURS: 'It does not exist, or belongs to another project.',
  DISK_FULL: 'The server’s disk is full: delete scenes that are not needed.',
  JOB_ACTIVE: 'Wait for the training that is running, or cancel it.',
  NO_MODEL: 'Train the scene first.',
  NO_SNAPSHOT: 'The page asks again by itself.',
  NO_SAM: 'The mask stays as it is. Ask who runs the server to install SAM.',
  DRAINING: 'The server is being restarted; the page continues by itself.',
};

const adviceByCode: Partial<Record<Code, string>> = {
  [Code.NotFound]: 'It may have been deleted: go back to the scenes.',
  [Code.ResourceExhausted]: 'Delete what is not needed, or ask who runs the server for more.',
  [Code.Unavailable]: 'The page tries again by itself.',
  [Code.DeadlineExceeded]: 'The server took too long: try again.',
  [Code.DataLoss]: 'Bytes were damaged on the way or on the disk: try again.',
  [Code.Internal]: 'The server’s log says more. Try again.',
  [Code.Unimplemented]: 'The server is older than the app: update it.',
};

/** Pause before a job is asked again, if the server names none. */
const earlyPauseMs = 1000;

/** fetch reports a lost connection as a TypeError, in every browser. */
function isNetwork(error: ConnectError): boolean {
  return (
    error.cause instanceof TypeError ||
    /failed to fetch|networkerror|load failed/i.test(error.rawMessage)
  );
}

function sentence(text: string): string {
  const trimmed = text.trim();
  if (trimmed === '') return 'Something went wrong.';
  const first = trimmed.charAt(0).toUpperCase() + trimmed.slice(1);
  return /[.!?]$/.test(first) ? first : `${first}.`;
}

export function failureOf(cause: unknown): Failure {
  const error = ConnectError.from(cause);
  const detail = detailOf(error);
  const network = isNetwork(error);
  // A job that trains says by this that it has no state yet: the server answers.
  const isEarly = detail?.reason === 'NO_SNAPSHOT';
  const away = network || (error.code === Code.Unavailable && !isEarly);
  // The back end says at which address it looked for the server, and how to start one.
  const said = error.rawMessage.startsWith('the server does not answer');
  const todo = (detail && advice[detail.reason]) ?? adviceByCode[error.code] ?? '';
  const what = (detail && plainWords[detail.reason]) ?? sentence(error.rawMessage);
  return {
    what: away && !detail && !said ? 'The server does not answer.' : what,
    todo: network ? 'Is it running? The page tries again by itself.' : todo,
    code: error.code,
    reason: detail?.reason ?? '',
    resource: detail?.resource ?? '',
    limit: detail?.limit ?? '',
    away,
    isEarly,
    retryMs: detail?.retryMs ?? (isEarly ? earlyPauseMs : undefined),
  };
}

export function isCancelled(cause: unknown): boolean {
  if (cause instanceof DOMException && cause.name === 'AbortError') return true;
  return ConnectError.from(cause).code === Code.Canceled;
}
