import type { JSX } from 'preact';
import { bytesText, countText } from '../format';
import { useStore } from '../store';
import type { RunningTask, TaskStep } from './running_task';

function stepText({ name, unit, done, total }: TaskStep): string {
  if (total === 0) return done === 0 ? `${name} …` : `${name}: ${bytesText(done)}`;
  if (unit === 'bytes') return `${name}: ${bytesText(done)} of ${bytesText(total)}`;
  const steps = `${name}: ${countText(done)} of ${countText(total)}`;
  return unit === 'masks' ? `${steps} masks` : steps;
}

/** What is done now, how far it is, and a button that ends it. */
export function TaskProgress({ running }: { running: RunningTask }): JSX.Element | null {
  const { step } = useStore(running.state);
  if (!step) return null;
  const { name, done, total } = step;
  // Without a value the bar moves to and fro.
  const share = total > 0 ? { max: total, value: done } : {};
  return (
    <div class="row">
      <div class="export">
        <progress {...share} aria-label={name} />
        <span class="quiet" role="status">
          {stepText(step)}
        </span>
      </div>
      <button type="button" onClick={() => running.cancel()}>
        Cancel
      </button>
    </div>
  );
}
