// Buttons over the 3D view: what a drag does, and how deep it picks.
import type { JSX } from 'preact';
import type { IconName } from '../components/icons';
import { Icon } from '../components/icons';
import { countText } from '../format';
import { useStore } from '../store';
import type { GaussianEdits } from './gaussian_edits';
import { waitText } from './gaussian_tools';
import type { DragTool, Picking } from './use_picking';

const drags: readonly { drag: DragTool; name: string; icon: IconName; title: string }[] = [
  { drag: 'turn', name: 'Turn', icon: 'turn', title: 'A drag turns the view' },
  { drag: 'box', name: 'Pick by box', icon: 'box', title: 'A drag picks what is in a box (Shift+R)' },
  {
    drag: 'lasso',
    name: 'Pick by lasso',
    icon: 'lasso',
    title: 'A drag picks what is in a free outline (Shift+F)',
  },
];

interface Props {
  edits: GaussianEdits;
  picking: Picking;
  onPicking: (picking: Picking) => void;
}

/** What is picked, and what to do with it. */
function PickedBar({ edits }: { edits: GaussianEdits }): JSX.Element {
  const { numPicked, edits: edited } = useStore(edits.state);
  return (
    <div class="pane-buttons" role="group" aria-label="What is picked">
      <span class="count">{`${countText(numPicked)} picked`}</span>
      <button type="button" title="Hide what is picked (Delete)" onClick={() => edits.hidePicked()}>
        Hide
      </button>
      <button
        type="button"
        title="Show only what is picked"
        aria-pressed={edited.isAlone}
        onClick={() => edits.showAlone(!edited.isAlone)}
      >
        Only
      </button>
      <button
        type="button"
        aria-label="Pick nothing"
        title="Pick nothing"
        onClick={() => edits.clear()}
      >
        <Icon name="close" />
      </button>
    </div>
  );
}

export function PickBar({ edits, picking, onPicking }: Props): JSX.Element {
  const { drag, frontOnly } = picking;
  const state = useStore(edits.state);
  const waits = waitText(state);
  return (
    <div class="pick-bar">
      <div class="pane-buttons" role="group" aria-label="Picks and crop box in 3D">
        {drags.map(({ drag: other, name, icon, title }) => (
          <button
            key={other}
            type="button"
            aria-label={name}
            title={title}
            aria-pressed={drag === other}
            onClick={() => onPicking({ ...picking, drag: other })}
          >
            <Icon name={icon} />
          </button>
        ))}
        {drag !== 'turn' && (
          <button
            type="button"
            title="Pick only what is in front, not what is behind it"
            aria-pressed={frontOnly}
            onClick={() => onPicking({ ...picking, frontOnly: !frontOnly })}
          >
            In front
          </button>
        )}
        <button
          type="button"
          aria-label="Crop box"
          title="Hide all outside a box (C)"
          aria-pressed={state.edits.crop !== undefined}
          onClick={() => void edits.turnCrop(state.edits.crop === undefined)}
        >
          <Icon name="crop" />
        </button>
      </div>
      {state.numPicked > 0 && <PickedBar edits={edits} />}
      {waits && <span class="pane-buttons count">{waits}</span>}
    </div>
  );
}

/** The outline while it is drawn. */
export function OutlineMark({ outline }: { outline: readonly { x: number; y: number }[] }): JSX.Element {
  const corners = outline.map(({ x, y }) => `${x.toFixed(1)} ${y.toFixed(1)}`);
  return (
    <svg class="overlay" aria-hidden="true">
      <path class="mark-box" d={`M${corners.join('L')}Z`} />
    </svg>
  );
}
