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

/** Returns a set as in GaussianBits of the contract. */
export function bitsOf(set: GaussianSet): Uint8Array<ArrayBuffer> {
  const bits = new Uint8Array(Math.ceil(set.length / 8));
  for (let i = 0; i < set.length; ++i) {
    if (set[i]) bits[i >> 3] = (bits[i >> 3] as number) | (1 << (i & 7));
  }
  return bits;
}

/** Returns the set of `count` Gaussians that the bits of GaussianBits say. Throws if they are of another number. */
export function setOfBits(bits: Uint8Array, count: number): GaussianSet {
  if (bits.length !== Math.ceil(count / 8)) {
    throw new Error(`${bits.length} bytes are not the bits of ${count} Gaussians`);
  }
  return Uint8Array.from({ length: count }, (_, i) => ((bits[i >> 3] as number) >> (i & 7)) & 1);
}
