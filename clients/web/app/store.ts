// A value that components subscribe to.
import { useEffect, useState } from 'preact/hooks';

export class Store<T> {
  private readonly followers = new Set<() => void>();

  constructor(private value: T) {}

  get(): T {
    return this.value;
  }

  set(value: T): void {
    if (Object.is(value, this.value)) return;
    this.value = value;
    for (const follower of [...this.followers]) follower();
  }

  /** Replaces some fields of an object. */
  patch(change: Partial<T>): void {
    this.set({ ...this.value, ...change });
  }

  follow(follower: () => void): () => void {
    this.followers.add(follower);
    return () => this.followers.delete(follower);
  }
}

export function useStore<T>(store: Store<T>): T {
  const [, again] = useState({});
  useEffect(() => {
    // The value may have changed between the first rendering and here.
    again({});
    return store.follow(() => again({}));
  }, [store]);
  return store.get();
}
