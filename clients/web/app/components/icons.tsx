import type { JSX } from 'preact';

const paths = {
  back: 'M15 5l-7 7 7 7',
  plus: 'M12 5v14M5 12h14',
  trash: 'M5 7h14M10 7V5h4v2M7 7l1 12h8l1-12',
  undo: 'M9 7L4 12l5 5M4 12h10a5 5 0 010 10',
  redo: 'M15 7l5 5-5 5M20 12H10a5 5 0 000 10',
  close: 'M6 6l12 12M18 6L6 18',
  check: 'M5 12l5 5 9-10',
  help: 'M9 9a3 3 0 115 2c-1 1-2 1.500-2 3M12 18v.5',
  cube: 'M12 3l8 4.500v9L12 21l-8-4.500v-9zM12 12l8-4.500M12 12v9M12 12L4 7.500',
  photo: 'M4 6h16v12H4zM4 15l4-4 4 4 3-3 5 4M15.500 9.500h.01',
  upload: 'M12 16V5m-5 5l5-5 5 5M5 20h14',
  box: 'M4 8V4h4M16 4h4v4M20 16v4h-4M8 20H4v-4',
  brush: 'M5 19c3 1 6 0 6-3a3 3 0 00-6 0c0 1.500-1 2-2 2M10.500 13.500L20 4M13 16l-2-4',
  lasso: 'M7 16c-3-1-4-3-4-5 0-4 4-6 9-6s9 2 9 6-4 6-9 6c-2 0-3-.5-3-2s3-1.500 3 .5c0 2-2 4-5 5',
  paint: 'M5 20h14M12 4v10M7 9h10',
  erase: 'M5 20h14M4 14l8-9 7 6-6 6H7z',
  search: 'M11 4a7 7 0 100 14 7 7 0 000-14zM16 16l4 4',
  minus: 'M6 12h12',
  home: 'M4 11l8-7 8 7M6 10v9h12v-9',
  camera: 'M4 8h4l2-3h4l2 3h4v11H4zM12 10a3 3 0 100 6 3 3 0 000-6z',
  both: 'M4 5h16v14H4zM12 5v14',
  panel: 'M4 5h16v14H4zM15 5v14',
  segments: 'M4 4h7v9H4zM14 4h6v5h-6zM14 12h6v8h-6zM4 16h7v4H4z',
  eye: 'M3 12c3-5 6-7 9-7s6 2 9 7c-3 5-6 7-9 7s-6-2-9-7zM12 9.500a2.500 2.500 0 100 5 2.500 2.500 0 000-5z',
  unseen: 'M3 12c3-5 6-7 9-7s6 2 9 7c-3 5-6 7-9 7s-6-2-9-7zM12 9.500a2.500 2.500 0 100 5 2.500 2.500 0 000-5zM4 20L20 4',
  turn: 'M4 12a8 4 0 1012-3.500M16 8.500l.5 4M16 8.500l4 .5M12 4v16',
  crop: 'M7 3v14h14M3 7h14v14',
  warn: 'M12 4l9 16H3zM12 10v4M12 17v.01',
};

export type IconName = keyof typeof paths;

/** Next to words, or within something with a label: hidden from screen readers. */
export function Icon({ name }: { name: IconName }): JSX.Element {
  return (
    <svg class="icon" viewBox="0 0 24 24" aria-hidden="true" focusable="false">
      <path d={paths[name]} />
    </svg>
  );
}
