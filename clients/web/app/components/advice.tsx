import type { JSX } from 'preact';
import { Icon } from './icons';

/** What may make masks poor and how to get better ones; nothing if the server has no advice. */
export function Advice({ advice }: { advice: readonly string[] | undefined }): JSX.Element | null {
  if (!advice || advice.length === 0) return null;
  return (
    <div class="note advice" role="note" aria-label="Advice">
      <Icon name="help" />
      <div>
        {advice.map((sentence) => (
          <p key={sentence}>{sentence}</p>
        ))}
      </div>
    </div>
  );
}
