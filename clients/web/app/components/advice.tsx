import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { Icon } from './icons';

/** Returns the name under which the browser remembers that advice was closed. */
function closedName(about: string): string {
  return `pepeseg-advice-closed-${about}`;
}

function isClosed(about: string): boolean {
  try {
    return localStorage.getItem(closedName(about)) !== null;
  } catch {
    return false; // the browser stores nothing for this page
  }
}

function rememberClosed(about: string): void {
  try {
    localStorage.setItem(closedName(about), '');
  } catch {
    // Without a store the advice is back after a reload.
  }
}

interface Props {
  /** Name of the resource that the advice is about; closed once, it stays closed. */
  about: string;
  /** One sentence; absent: there is no advice. */
  text: string | undefined;
}

/** One line of advice, which can be closed. */
export function Advice({ about, text }: Props): JSX.Element | null {
  const [closed, setClosed] = useState(isClosed(about));
  if (!text || closed) return null;
  const close = () => {
    rememberClosed(about);
    setClosed(true);
  };
  return (
    <div class="note advice" role="note" aria-label="Advice">
      <Icon name="help" />
      <p title={text}>{text}</p>
      <button type="button" class="bare" aria-label="Close this advice" onClick={close}>
        <Icon name="close" />
      </button>
    </div>
  );
}
