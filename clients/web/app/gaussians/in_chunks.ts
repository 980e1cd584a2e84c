// Work on all Gaussians of a model in the page's thread, which handles events and paints in between.

/** Time after which the thread is given back, milliseconds. */
const longestMs = 40;
/** Gaussians between two looks at the clock. */
const atATime = 1 << 14;

/** Ends in a task of its own. Unlike a timer it is not slowed down while the page is not shown. */
function nextTask(): Promise<void> {
  return new Promise((resolve) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => {
      port1.close();
      resolve();
    };
    port2.postMessage(undefined);
  });
}

/**
 * Calls `work` with the chunks from `first` to before `last` of 0 to before `count`, in their order. `now`:
 * the clock, milliseconds.
 */
export async function inChunks(
  count: number,
  work: (first: number, last: number) => void,
  now: () => number = () => performance.now(),
): Promise<void> {
  let begin = now();
  for (let first = 0; first < count; first += atATime) {
    work(first, Math.min(count, first + atATime));
    if (now() - begin < longestMs) continue;
    await nextTask();
    begin = now();
  }
}
