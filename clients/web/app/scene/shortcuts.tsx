import type { JSX } from 'preact';
import { useEffect, useRef } from 'preact/hooks';
import { Dialog } from '../components/dialog';

export type Shortcuts = Readonly<Record<string, () => void>>;

/** Returns whether a key press belongs to what has the focus: a dialog, or a field, except for Esc. */
function isTaken({ key, isComposing, target }: KeyboardEvent): boolean {
  const focused = target as HTMLElement;
  if (isComposing || focused.closest('dialog')) return true;
  return key !== 'Escape' && focused.closest('input[type=text], input[type=number], textarea, select') !== null;
}

/** Shortcuts of the whole screen. While somebody types, only Esc is one. */
export function useShortcuts(shortcuts: Shortcuts): void {
  // Effects run after the screen is drawn. A key may be pressed before that, and means what the
  // newest shortcuts say.
  const newest = useRef(shortcuts);
  newest.current = shortcuts;
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      if (isTaken(event)) return;
      const held = event.ctrlKey || event.metaKey ? 'Ctrl+' : '';
      const act = event.altKey ? undefined : newest.current[held + event.key];
      if (!act) return;
      event.preventDefault();
      act();
    };
    window.addEventListener('keydown', press);
    return () => window.removeEventListener('keydown', press);
  }, []);
}

const list: readonly (readonly [string, string])[] = [
  ['Click', 'Segment what is there, in the view or in 3D'],
  ['Shift + click', 'Exclude what is there'],
  ['Drag in the view', 'Draw a box around what is meant'],
  ['Arrow keys', 'Move the cursor in the view; turn the 3D view'],
  ['Enter, Shift + Enter', 'Include, exclude what is under the cursor'],
  ['Drag with the brush', 'Draw over what is meant; with Shift, over what is not'],
  ['Enter with the brush', 'Begin and end a stroke, which the arrow keys draw'],
  ['I, E, R, D', 'Include, exclude, box (rectangle), brush (draw)'],
  ['F, J, K', 'Lasso (free outline), paint on the mask, erase from it'],
  ['X, < and >', 'Brush: what is meant or not, thinner and wider; paint or erase'],
  [', and .', 'Next smaller, next larger size'],
  ['1, 2, 3', 'Photograph, both, 3D'],
  ['Wheel, + and -', 'Zoom in the photograph; 0 shows all of it'],
  ['Drag with Space or the middle button', 'Move the zoomed photograph; two fingers on a touch screen'],
  ['H, B', '3D: all of the scene, back to the photograph’s camera'],
  ['Double click in 3D', 'Turn about what is there'],
  ['Shift + R, Shift + F', '3D: pick Gaussians by box, by lasso; again, or Esc: turn'],
  ['Shift, Alt + drag while picking', 'Add to what is picked, take away from it'],
  ['M', '3D: the photographs’ cameras, on or off; a click on one goes to its view'],
  ['C', '3D: crop box, on or off'],
  ['Delete', 'Hide the picked Gaussians'],
  ['G, R, S while something is moved', 'The handles in 3D move, rotate, scale it'],
  ['Enter, Esc while something is moved', 'Make the move, with the 3D view in focus; drop it'],
  ['P', 'Fold or open the side panel'],
  ['[ and ]', 'View before, next view'],
  ['U', 'Preview of a click under the pointer, on or off'],
  ['V', 'Photograph or rendering'],
  ['G', 'Everything: all segments of the view, on or off'],
  ['/', 'Find by a word'],
  ['A', 'Find all like the segment'],
  ['L', 'Name the segment'],
  ['N', 'Named things in their colours, on or off'],
  ['S', 'Select in 3D'],
  ['T, O, W', 'Selection tinted, only it, without it'],
  ['Ctrl + Z, Ctrl + Shift + Z', 'Undo, redo: clicks, masks, names, and what is done in 3D'],
  ['Esc', 'Clear, also while you type a name; end everything'],
  ['?', 'This list'],
];

export function ShortcutList({ onClose }: { onClose: () => void }): JSX.Element {
  return (
    <Dialog title="Keyboard and mouse" onClose={onClose}>
      <dl class="shortcuts">
        {list.map(([keys, what]) => (
          <div key={keys}>
            <dt>{keys}</dt>
            <dd>{what}</dd>
          </div>
        ))}
      </dl>
    </Dialog>
  );
}
