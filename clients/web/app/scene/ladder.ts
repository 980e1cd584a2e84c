// The sizes that a prompt may mean, from the smallest mask to the largest: what the size slider goes
// along. The shown answer is always one of them, so that the slider's position is true.
import { overlapOf } from '../mask/rle';
import type { Mask, Proposal } from './answer';
import type { Granularity } from './prompt';

/** Masks that overlap more than this look the same to a person: the slider has one of them. */
const sameIou = 0.95;

export interface Rung {
  /** What the server is asked with for this mask; empty: the server chooses. */
  readonly granularity: Granularity;
  readonly scale: number;
  readonly threshold: number;
  /** In the prompt's view. */
  readonly mask: Mask;
}

export interface Ladder {
  readonly rungs: readonly Rung[];
  /** Index of the rung that is shown; undefined while there is no answer. */
  readonly at: number | undefined;
  /** Index of the rung that the server chooses if nothing is chosen; undefined: it is not known. */
  readonly guess: number | undefined;
  /** False while the rungs are those of the prompt before. */
  readonly isCurrent: boolean;
}

export const noLadder: Ladder = { rungs: [], at: undefined, guess: undefined, isCurrent: false };

/**
 * Returns the ladder of the proposals and the shown answer, by area. Of neighbours with nearly the same
 * mask, the answer stays, or else the server's guess, or else the smaller one.
 */
export function ladderOf(proposals: readonly Proposal[], answer: Rung | undefined): Ladder {
  const best = proposals.find((proposal) => proposal.best);
  const isOpen =
    answer?.granularity.scale === undefined && answer?.granularity.threshold === undefined;
  const offered = proposals.map((proposal) => ({
    rung: {
      granularity: { scale: proposal.scale, threshold: proposal.threshold },
      scale: proposal.scale,
      threshold: proposal.threshold,
      mask: proposal.mask,
    },
    rank: proposal === best ? 1 : 0,
  }));
  const all = answer && answer.mask.area > 0 ? [...offered, { rung: answer, rank: 2 }] : offered;
  all.sort((a, b) => a.rung.mask.area - b.rung.mask.area || a.rank - b.rank);
  const kept: typeof all = [];
  for (const next of all) {
    const last = kept.at(-1);
    const isSame = last && overlapOf(last.rung.mask.rle, next.rung.mask.rle) > sameIou;
    if (!isSame) kept.push(next);
    else kept[kept.length - 1] = next.rank > last.rank ? next : last;
  }
  const indexOf = (wanted: Rung | undefined) => {
    const at = kept.findIndex(({ rung }) => rung === wanted);
    return at < 0 ? undefined : at;
  };
  const guessed = offered.find(({ rank }) => rank === 1)?.rung;
  const at = indexOf(answer);
  const guess = answer && isOpen ? at : indexOf(guessed) ?? nearest(kept, guessed);
  return { rungs: kept.map(({ rung }) => rung), at, guess, isCurrent: true };
}

/** Returns the index of the rung whose mask overlaps most with that of a rung that was left out. */
function nearest(kept: readonly { rung: Rung }[], wanted: Rung | undefined): number | undefined {
  if (!wanted) return undefined;
  const overlaps = kept.map(({ rung }) => overlapOf(rung.mask.rle, wanted.mask.rle));
  const most = Math.max(...overlaps);
  return most > sameIou ? overlaps.indexOf(most) : undefined;
}

/** Describes the shown rung: "2 of 4, larger" than the server's guess. Empty without one. */
export function describeRung({ rungs, at, guess, isCurrent }: Ladder): string {
  if (at === undefined) return '';
  if (rungs.length === 1) return isCurrent ? 'the only size' : '';
  const place = `${at + 1} of ${rungs.length}`;
  if (guess === undefined) return place;
  return `${place}, ${at === guess ? 'best guess' : at < guess ? 'smaller' : 'larger'}`;
}
