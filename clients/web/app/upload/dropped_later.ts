// Files that were dropped on another screen, for the screen of a new scene.
import type { DroppedFile } from './dataset_files';

let dropped: readonly DroppedFile[] = [];

export function keepDropped(files: readonly DroppedFile[]): void {
  dropped = files;
}

/** Returns the files that were kept, once. */
export function takeDropped(): readonly DroppedFile[] {
  const files = dropped;
  dropped = [];
  return files;
}
