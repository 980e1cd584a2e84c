// Drawing over the 3D view: a box or a free outline, which picks the Gaussians inside. Positions are pixels
// of the screen from the view's corner.
import { useEffect, useLayoutEffect, useState } from 'preact/hooks';
import { outlined } from '../mask/edit_mask';
import { decodeRle } from '../mask/rle';
import type { SplatViewer } from '../viewer/splat_viewer';
import type { GaussianEdits } from './gaussian_edits';
import type { Combination } from './gaussian_set';
import { inFrontOf, pickInside } from './pick';

/** What a drag in 3D does. */
export const dragTools = ['turn', 'box', 'lasso'] as const;

export type DragTool = (typeof dragTools)[number];

export interface Picking {
  readonly drag: DragTool;
  /** Whether only what is in front is picked. */
  readonly frontOnly: boolean;
}

interface Spot {
  readonly x: number;
  readonly y: number;
}

interface Drawing {
  readonly how: Combination;
  /** The outline's corners; of a box, the corner where it began and the opposite one. */
  readonly path: readonly Spot[];
}

interface Modifiers {
  readonly shiftKey: boolean;
  readonly altKey: boolean;
}

/** Steps of a lasso that are shorter than this are left out. */
const shortest = 3;
/** Shares of the view that the keyboard's box leaves out at each side. */
const keyMargin = 1 / 3;

function combinationOf({ shiftKey, altKey }: Modifiers): Combination {
  if (altKey) return 'subtract';
  return shiftKey ? 'add' : 'replace';
}

function cornersOf(a: Spot, b: Spot): Spot[] {
  return [a, { x: b.x, y: a.y }, b, { x: a.x, y: b.y }];
}

function spotOf(event: PointerEvent): Spot {
  const edges = (event.currentTarget as Element).getBoundingClientRect();
  return { x: event.clientX - edges.left, y: event.clientY - edges.top };
}

export function usePicking(
  { drag, frontOnly }: Picking,
  edits: GaussianEdits,
  viewer: { readonly current: SplatViewer | undefined },
) {
  const [drawing, setDrawing] = useState<Drawing>();
  const draws = drag !== 'turn';
  // Before the next event, which may begin something with the new tool.
  useLayoutEffect(() => setDrawing(undefined), [edits, drag]);
  useEffect(() => {
    if (draws) void edits.load();
  }, [edits, draws]);
  const outline = drawing && drag === 'box' && drawing.path.length === 2
    ? cornersOf(...(drawing.path as [Spot, Spot]))
    : (drawing?.path ?? []);

  const pick = (path: readonly Spot[], how: Combination) => {
    const sight = viewer.current?.sight();
    if (!sight) return;
    const inside = decodeRle(outlined(path, sight.width, sight.height));
    void edits.pick(async (gaussians) => {
      const drawn = viewer.current?.drawn() ?? new Uint8Array(gaussians.count);
      const all = await pickInside(gaussians, sight, inside, drawn);
      return frontOnly ? inFrontOf(gaussians, sight, all, drawn) : all;
    }, how);
  };
  return {
    draws,
    outline,
    /** Picks what is in a box in the middle of the view. */
    pickMiddle: (modifiers: Modifiers) => {
      const { width = 0, height = 0 } = viewer.current?.sight() ?? {};
      const first = { x: width * keyMargin, y: height * keyMargin };
      pick(cornersOf(first, { x: width - first.x, y: height - first.y }), combinationOf(modifiers));
    },
    press: (event: PointerEvent) => {
      if (!draws || event.button !== 0) return;
      setDrawing({ how: combinationOf(event), path: [spotOf(event)] });
    },
    move: (event: PointerEvent) => {
      const [first, last] = [drawing?.path[0], drawing?.path.at(-1)];
      if (!drawing || !first || !last) return;
      const spot = spotOf(event);
      if (drag === 'box') setDrawing({ ...drawing, path: [first, spot] });
      else if (Math.hypot(spot.x - last.x, spot.y - last.y) >= shortest) {
        setDrawing({ ...drawing, path: [...drawing.path, spot] });
      }
    },
    release: () => {
      setDrawing(undefined);
      if (drawing && outline.length > 2) pick(outline, drawing.how);
    },
    drop: () => setDrawing(undefined),
  };
}
