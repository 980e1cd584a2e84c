// Sets of Gaussians.

/** 1 for each Gaussian of a model that is in the set, else 0. Sets do not change. */
export type GaussianSet = Readonly<Uint8Array>;

export type Combination = 'replace' | 'add' | 'subtract';

/** Returns a set and what was found, combined. */
export function combined(base: GaussianSet, found: GaussianSet, how: Combination): GaussianSet {
  if (how === 'replace') return found;
  const isAdded = how === 'add';
  return base.map((isIn, i) => (found[i] ? Number(isAdded) : isIn));
}

export function complementOf(set: GaussianSet): GaussianSet {
  return set.map((isIn) => 1 - isIn);
}

export function sizeOfSet(set: GaussianSet): number {
  let count = 0;
  for (let i = 0; i < set.length; ++i) count += set[i] as number;
  return count;
}
