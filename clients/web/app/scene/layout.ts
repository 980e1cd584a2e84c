// Which panes of a scene are shown, and whether the side panel is open. The browser remembers both.
import { useState } from 'preact/hooks';
import { recall, remember } from '../remembered';
import { queryValue, setQueryValue } from '../router';

export type Panes = 'photo' | 'both' | '3d';

export interface Layout {
  readonly panes: Panes;
  readonly isPanelOpen: boolean;
  show(panes: Panes): void;
  openPanel(isOpen: boolean): void;
}

const panesName = 'pepeseg-panes';
const panelName = 'pepeseg-panel';
/** Name of the panes in the URL's query. */
const queryName = 'show';

function panesIn(text: string | undefined): Panes | undefined {
  return text === 'photo' || text === 'both' || text === '3d' ? text : undefined;
}

/** Returns the layout that the URL says, else the one of the last visit. */
export function useLayout(): Layout {
  const [panes, setPanes] = useState<Panes>(
    () => panesIn(queryValue(queryName)) ?? panesIn(recall(panesName)) ?? 'both',
  );
  const [isPanelOpen, setPanelOpen] = useState(() => recall(panelName) !== 'closed');
  return {
    panes,
    isPanelOpen,
    show: (next) => {
      setPanes(next);
      remember(panesName, next);
      setQueryValue(queryName, next);
    },
    openPanel: (isOpen) => {
      setPanelOpen(isOpen);
      remember(panelName, isOpen ? 'open' : 'closed');
    },
  };
}

/** Returns the panes that fit: a narrow screen shows one of them. */
export function panesOn(narrow: boolean, panes: Panes): Panes {
  return narrow && panes === 'both' ? 'photo' : panes;
}
