// Controls in the header of a scene: which panes are shown, and the side panel.
import type { JSX } from 'preact';
import type { IconName } from '../components/icons';
import { Icon } from '../components/icons';
import { useNarrow } from '../use_narrow';
import type { Layout, Panes } from './layout';
import { panesOn } from './layout';

const choices: readonly { panes: Panes; name: string; icon: IconName; key: string }[] = [
  { panes: 'photo', name: 'Photograph', icon: 'photo', key: '1' },
  { panes: 'both', name: 'Both', icon: 'both', key: '2' },
  { panes: '3d', name: '3D', icon: 'cube', key: '3' },
];

interface Props {
  layout: Layout;
  /** Whether there is a model to show in 3D. */
  has3d?: boolean;
}

export function LayoutSwitch({ layout, has3d = true }: Props): JSX.Element {
  const narrow = useNarrow();
  const shown = has3d ? panesOn(narrow, layout.panes) : 'photo';
  const { isPanelOpen } = layout;
  return (
    <>
      <div class="segmented" role="group" aria-label="What is shown">
        {choices
          .filter(({ panes }) => !narrow || panes !== 'both')
          .map(({ panes, name, icon, key }) => (
            <button
              key={panes}
              type="button"
              aria-pressed={panes === shown}
              disabled={!has3d && panes !== 'photo'}
              title={has3d || panes === 'photo' ? `${name} (${key})` : `${name}: after the training`}
              onClick={() => layout.show(panes)}
            >
              <Icon name={icon} />
              {name}
            </button>
          ))}
      </div>
      {!narrow && (
        <button
          type="button"
          class="bare"
          aria-label="Side panel"
          aria-expanded={isPanelOpen}
          aria-controls="tools"
          title={`${isPanelOpen ? 'Fold' : 'Open'} the side panel (P)`}
          onClick={() => layout.openPanel(!isPanelOpen)}
        >
          <Icon name="panel" />
        </button>
      )}
    </>
  );
}
