import type { JSX } from 'preact';
import type { Failure } from '../api/failure';
import { Icon } from './icons';

interface Props {
  failure: Failure | undefined;
  again?: (() => void) | undefined;
  close?: (() => void) | undefined;
}

/** What went wrong and what to do; nothing without a failure. */
export function FailureNote({ failure, again, close }: Props): JSX.Element | null {
  if (!failure) return null;
  return (
    <div class="note bad" role="alert">
      <Icon name="warn" />
      <div>
        <strong>{failure.what}</strong>
        {failure.todo && <p>{failure.todo}</p>}
        {failure.limit && !failure.what.includes(failure.limit) && <p>Limit: {failure.limit}</p>}
      </div>
      {again && (
        <button type="button" onClick={again}>
          Try again
        </button>
      )}
      {close && (
        <button type="button" class="bare" aria-label="Close this message" onClick={close}>
          <Icon name="close" />
        </button>
      )}
    </div>
  );
}
