// Values that the browser keeps for this page, if it lets the page store anything.

/** Returns the value stored under a name; undefined if there is none. */
export function recall(name: string): string | undefined {
  try {
    return localStorage.getItem(name) ?? undefined;
  } catch {
    return undefined; // the browser stores nothing for this page
  }
}

export function remember(name: string, value: string): void {
  try {
    localStorage.setItem(name, value);
  } catch {
    // Without a store the value is forgotten at a reload.
  }
}
