// Describes the answer to a prompt in words for the screen.
import { countText } from '../format';
import type { SessionState } from './session_state';
import { isForSam } from './session_state';

function viewsText(count: number): string {
  return `${count} ${count === 1 ? 'view' : 'views'}`;
}

type Shown = Pick<
  SessionState,
  'prompt' | 'granularity' | 'samClicks' | 'answer' | 'busy' | 'looking' | 'current'
>;

const placedBy = {
  photograph: ', by SAM in the photograph',
  rendering: ', by SAM in the rendering',
} as const;

/** Returns what was found in the shown view, and in others or what is still looked at. */
export function describeAnswer(
  state: Shown,
  shownView: string,
  views: readonly string[],
): string {
  const { answer, busy, looking, current } = state;
  if (!answer) return busy ? 'Looking …' : 'Not answered.';
  const { area, samImage } = answer.masks.get(shownView) ?? {};
  const isDone = current.has(shownView) && isForSam(state);
  const by = samImage ? placedBy[samImage] : isDone ? ', by the model' : '';
  const pixels = area === undefined ? '' : `${countText(area)} pixels here${by}. `;
  const here = area === 0 ? 'Not seen in this view. ' : pixels;
  if (busy) return `${here}Looking …`;
  const left = views.filter((view) => !current.has(view)).length;
  if (looking && left > 0) {
    const others = `${left} other ${left === 1 ? 'view' : 'views'}`;
    const looks = isForSam(state) && state.samClicks === 'on' ? 'SAM is looking' : 'Looking';
    return `${here}${looks} in ${left === views.length ? viewsText(left) : others} …`;
  }
  const seen = [...answer.masks.values()].filter((mask) => mask.view && mask.area > 0).length;
  return `${here}Seen in ${viewsText(seen)}.`;
}
