// The server's errors for browsers.
import { Code, ConnectError } from '@connectrpc/connect';
import { startAdvice } from './start_advice';

/** The HTTP/2 client's errors if the other side goes away during a call. */
const lost = new Set([Code.Canceled, Code.Aborted]);
const lostWords = /stream closed|socket|ECONN|missing (trailer|status)|premature/i;

/**
 * Returns the error without its headers, which are about another connection. `signal`: the caller's. A
 * call that nobody here aborted was lost with the connection: that is not a cancellation, and a
 * repetition may help.
 */
export function passedOn(error: unknown, signal: AbortSignal): ConnectError {
  const from = ConnectError.from(error);
  // All errors of the server itself have a detail.
  const own = from.details.length > 0 || signal.aborted;
  const transport = from.code === Code.Internal || from.code === Code.Unknown;
  if (!own && (lost.has(from.code) || (transport && lostWords.test(from.rawMessage)))) {
    return new ConnectError('the connection to the server was lost', Code.Unavailable);
  }
  const nobody = /ECONNREFUSED (\S+)|connect ENOENT (\S+)/.exec(from.rawMessage);
  if (!own && nobody) {
    const address = nobody[1] ?? `unix:${nobody[2]}`;
    const advice = startAdvice(address);
    const message = `the server does not answer. Nothing listens at ${address}`;
    return new ConnectError(advice ? `${message}; ${advice}` : message, Code.Unavailable);
  }
  const to = new ConnectError(from.rawMessage, from.code);
  to.details = from.details;
  return to;
}
