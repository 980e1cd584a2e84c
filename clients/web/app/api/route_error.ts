// Errors of the back end's routes that are not RPCs (server/answer.ts).
import { Code, ConnectError } from '@connectrpc/connect';

/** Returns the error that an answer of this status and body reports. */
export function routeError(status: number, text: string): ConnectError {
  try {
    const body = JSON.parse(text) as { code: Code; message: string };
    return new ConnectError(body.message, body.code);
  } catch {
    return new ConnectError(`the app's back end answers ${status}`, Code.Unavailable);
  }
}
