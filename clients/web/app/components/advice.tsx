import type { JSX } from 'preact';
import { Icon } from './icons';

/** What may make answers poor and what would better them; nothing where the server says nothing. */
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
