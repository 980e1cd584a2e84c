// Describes the answer to a prompt in words for the screen.
import { countText } from '../format';
import type { Answer } from './answer';
import type { SessionState } from './session_state';
import { isForSam } from './session_state';

export function viewsText(count: number): string {
  return `${count} ${count === 1 ? 'view' : 'views'}`;
}

/** Returns the number of views whose masks are not empty. */
export function numViewsOf({ masks }: Answer): number {
  return [...masks.values()].filter(({ view, area }) => view && area > 0).length;
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
  return `${here}Seen in ${viewsText(numViewsOf(answer))}.`;
}
