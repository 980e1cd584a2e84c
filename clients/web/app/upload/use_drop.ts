// Files that are dropped on an element, or anywhere on the page.
import { useEffect, useState } from 'preact/hooks';
import type { DroppedFile } from './dataset_files';
import { filesOfDrop } from './dropped_files';

function hasFiles({ dataTransfer }: DragEvent): boolean {
  return dataTransfer?.types.includes('Files') === true;
}

/** Returns whether files are over the element, and its handlers. */
export function useDrop(onFiles: (files: DroppedFile[]) => void) {
  const [isOver, setOver] = useState(false);
  const onDragOver = (event: DragEvent) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    setOver(true);
  };
  const onDragLeave = ({ currentTarget, relatedTarget }: DragEvent) => {
    // Going from the element to one inside it is not leaving it.
    if (!(currentTarget as Node).contains(relatedTarget as Node | null)) setOver(false);
  };
  const take = async (event: DragEvent) => {
    event.preventDefault();
    setOver(false);
    if (event.dataTransfer) onFiles(await filesOfDrop(event.dataTransfer));
  };
  const onDrop = (event: DragEvent) => void take(event);
  return { isOver, handlers: { onDragOver, onDragLeave, onDrop } };
}

/** Takes files that are dropped anywhere on the page. Returns whether files are over it. */
export function usePageDrop(onFiles: (files: DroppedFile[]) => void): boolean {
  const { isOver, handlers } = useDrop(onFiles);
  useEffect(() => {
    const { onDragOver, onDragLeave, onDrop } = handlers;
    document.addEventListener('dragover', onDragOver);
    document.addEventListener('dragleave', onDragLeave);
    document.addEventListener('drop', onDrop);
    return () => {
      document.removeEventListener('dragover', onDragOver);
      document.removeEventListener('dragleave', onDragLeave);
      document.removeEventListener('drop', onDrop);
    };
  }, [onFiles]);
  return isOver;
}
