// Describes the answer to a prompt in words for the screen.
import { countText } from '../format';
import type { SessionState } from './session_state';

function viewsText(count: number): string {
  return `${count} ${count === 1 ? 'view' : 'views'}`;
}

type Shown = Pick<SessionState, 'answer' | 'busy' | 'looking' | 'current'>;

/** Returns what was found in the shown view, and in others or what is still looked at. */
export function describeAnswer(
  { answer, busy, looking, current }: Shown,
  shownView: string,
  views: readonly string[],
): string {
  if (!answer) return busy ? 'Looking …' : 'Not answered.';
  const area = answer.masks.get(shownView)?.area;
  const pixels = area === undefined ? '' : `${countText(area)} pixels here. `;
  const here = area === 0 ? 'Not seen in this view. ' : pixels;
  const left = views.filter((view) => !current.has(view)).length;
  if (looking && left > 0) {
    const others = `${left} other ${left === 1 ? 'view' : 'views'}`;
    return `${here}Looking in ${left === views.length ? viewsText(left) : others} …`;
  }
  const seen = [...answer.masks.values()].filter((mask) => mask.view && mask.area > 0).length;
  return `${here}Seen in ${viewsText(seen)}.`;
}
