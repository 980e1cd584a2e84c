// The part of a scene's screen that is in the address, so that a reload and a sent link show the same. Changes make no
// entries in the browser's history.
import { useEffect, useState } from 'preact/hooks';
import { queryValue, setQueryValue } from '../router';

/** Returns a word that the address has under a name; undefined: it has none. */
export function useLinkedText(name: string): [string | undefined, (text: string | undefined) => void] {
  const [text, setText] = useState(() => queryValue(name));
  useEffect(() => setQueryValue(name, text), [name, text]);
  return [text, setText];
}

/** Returns one of some words, which the address has under a name unless it is the first one. */
export function useLinkedWord<T extends string>(
  name: string,
  words: readonly [T, ...T[]],
): [T, (word: T) => void] {
  const [text, setText] = useLinkedText(name);
  const word = words.find((other) => other === text) ?? words[0];
  return [word, (next) => setText(next === words[0] ? undefined : next)];
}
