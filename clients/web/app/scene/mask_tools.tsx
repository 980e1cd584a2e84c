// Changes the shown mask as it is: its pieces, and what is drawn on it or around it.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { emptyMask, outlined, withLine } from '../mask/edit_mask';
import { largestPiece, withoutSmallPieces } from '../mask/pieces';
import type { Rle } from '../mask/rle';
import { useStore } from '../store';
import type { Size } from './photo_frame';
import type { Stroke } from './prompt';
import type { SceneSession } from './session';
import type { Tool } from './use_drawing';

/** Does what a stroke with a tool means in a view of this size. */
export function drawWith(
  tool: Tool,
  session: SceneSession,
  view: string,
  { width, height }: Size,
  stroke: Stroke,
): void {
  if (tool === 'lasso') {
    const rle = outlined(stroke.path, width, height);
    session.pose({ kind: 'mask', place: { view }, rle, isExact: false });
  } else if (tool === 'paint' || tool === 'erase') {
    const mask = session.state.get().answer?.masks.get(view)?.rle;
    if (!mask && stroke.negative) return;
    session.edit(view, withLine(mask ?? emptyMask(width, height), stroke, stroke.negative));
  } else {
    session.addStroke({ view }, stroke);
  }
}

interface Props {
  session: SceneSession;
  /** Name of the shown view. */
  view: string;
}

/** Buttons that drop pieces of the shown view's mask. */
export function PieceTools({ session, view }: Props): JSX.Element {
  const { answer, busy } = useStore(session.state);
  const mask = answer?.masks.get(view);
  const [said, setSaid] = useState('');
  useEffect(() => setSaid(''), [mask]);
  const canChange = mask !== undefined && mask.area > 0 && !busy;
  const keep = (choose: (rle: Rle) => Rle | undefined, otherwise: string) => {
    const changed = mask && choose(mask.rle);
    if (changed) session.edit(view, changed);
    else setSaid(otherwise);
  };
  return (
    <>
      <div class="row wrap pieces">
        <button
          type="button"
          class="chip"
          disabled={!canChange}
          onClick={() => keep(largestPiece, 'The mask is in one piece.')}
        >
          Largest piece
        </button>
        <button
          type="button"
          class="chip"
          disabled={!canChange}
          onClick={() => keep(withoutSmallPieces, 'The mask has no small pieces.')}
        >
          Drop small pieces
        </button>
      </div>
      <p class={`quiet ${said ? '' : 'gone'}`} role="status">
        {said}
      </p>
    </>
  );
}
