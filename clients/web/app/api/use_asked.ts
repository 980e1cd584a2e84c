// Fetches something from the server when a component appears or its arguments change.
import { useCallback, useEffect, useState } from 'preact/hooks';
import type { Failure } from './failure';
import { failureOf, isCancelled } from './failure';
import { steadily } from './server_link';

export interface Asked<T> {
  readonly value: T | undefined;
  readonly failure: Failure | undefined;
  readonly ask: () => void;
}

export function useAsked<T>(
  request: (signal: AbortSignal) => Promise<T>,
  about: unknown[],
): Asked<T> {
  const [value, setValue] = useState<T>();
  const [failure, setFailure] = useState<Failure>();
  const [round, setRound] = useState(0);
  const ask = useCallback(() => setRound((n) => n + 1), []);
  useEffect(() => {
    const controller = new AbortController();
    const { signal } = controller;
    steadily(() => request(signal), signal).then(
      (answer) => {
        if (signal.aborted) return;
        setValue(answer);
        setFailure(undefined);
      },
      (error: unknown) => {
        if (!signal.aborted && !isCancelled(error)) setFailure(failureOf(error));
      },
    );
    return () => controller.abort();
  }, [...about, round]);
  return { value, failure, ask };
}
