import type { JSX } from 'preact';
import { useRef } from 'preact/hooks';
import type { DroppedFile } from '../upload/dataset_files';
import { filesOfInput } from '../upload/dropped_files';
import { useDrop } from '../upload/use_drop';
import { Icon } from './icons';

interface Props {
  onFiles: (files: DroppedFile[]) => void;
}

/** Buttons that choose files or a folder. */
export function FileButtons({ onFiles }: Props): JSX.Element {
  const files = useRef<HTMLInputElement>(null);
  const folder = useRef<HTMLInputElement>(null);
  const picked = (event: Event) => onFiles(filesOfInput(event.currentTarget as HTMLInputElement));
  return (
    <>
      <div class="row center">
        <button type="button" onClick={() => files.current?.click()}>
          Choose files
        </button>
        <button type="button" onClick={() => folder.current?.click()}>
          Choose a folder
        </button>
      </div>
      <input
        ref={files}
        id="files"
        type="file"
        multiple
        hidden
        aria-label="Files"
        onChange={picked}
      />
      <input
        ref={folder}
        id="folder"
        type="file"
        hidden
        aria-label="Folder"
        {...{ webkitdirectory: true }}
        onChange={picked}
      />
    </>
  );
}

/** A frame on which photographs are dropped, with buttons for those who do not drag. */
export function DropZone({ onFiles }: Props): JSX.Element {
  const { isOver, handlers } = useDrop(onFiles);
  return (
    <div class={`drop ${isOver ? 'over' : ''}`} {...handlers}>
      <Icon name="upload" />
      <p>
        <strong>Drop photographs, a folder or a video here</strong>
      </p>
      <p class="quiet">
        Twenty or more photographs of the same things from all around. A folder may also bring
        poses, masks and depth.
      </p>
      <FileButtons onFiles={onFiles} />
    </div>
  );
}
