import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { serverLink, tryNow } from '../api/server_link';
import { useStore } from '../store';
import { Icon } from './icons';

/** A banner above all screens while the server does not answer. */
export function AwayBanner(): JSX.Element | null {
  const { away, what, nextTry } = useStore(serverLink);
  const [, tick] = useState(0);
  useEffect(() => {
    if (!away) return undefined;
    const timer = setInterval(() => tick((n) => n + 1), 500);
    return () => clearInterval(timer);
  }, [away]);
  if (!away) return null;
  const seconds = Math.max(0, Math.ceil((nextTry - Date.now()) / 1000));
  return (
    <div class="away" role="status">
      <Icon name="warn" />
      <span>
        {what} The page continues by itself when it is back
        <span aria-hidden="true">{seconds > 0 ? `; next try in ${seconds} s.` : '; trying …'}</span>
      </span>
      <button type="button" onClick={tryNow}>
        Try now
      </button>
    </div>
  );
}
