/** Number of names in a sentence; more would fill the screen. */
const mostNames = 5;

/** Returns names for a sentence: "a.jpg, b.jpg and 3 more". */
export function namesText(paths: readonly string[]): string {
  const shown = paths.slice(0, mostNames).join(', ');
  return paths.length > mostNames ? `${shown} and ${paths.length - mostNames} more` : shown;
}
