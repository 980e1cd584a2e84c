import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { recall, remember } from '../remembered';
import { Icon } from './icons';

/** Returns the name under which the browser remembers that advice was closed. */
function closedName(about: string): string {
  return `pepeseg-advice-closed-${about}`;
}

interface Props {
  /** Name of the resource that the advice is about; closed once, it stays closed. */
  about: string;
  /** One sentence; absent: there is no advice. */
  text: string | undefined;
}

/** One line of advice, which can be closed. */
export function Advice({ about, text }: Props): JSX.Element | null {
  const [closed, setClosed] = useState(() => recall(closedName(about)) !== undefined);
  if (!text || closed) return null;
  const close = () => {
    remember(closedName(about), '');
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
