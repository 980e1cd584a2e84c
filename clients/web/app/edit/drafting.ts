// An edit of the picked Gaussians that is shown in 3D, but not made yet: a move, a copy or another colour.
import type { Triple } from '../gaussians/crop_box';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import type { GaussianPly } from '../gaussians/gaussian_ply';
import type { GaussianSet } from '../gaussians/gaussian_set';
import { Store } from '../store';
import type { Move } from './move';
import { maxScale, middleOfSet, minScale, moves, noMove, rotationOf } from './move';
import type { EditRequest } from './edit_call';

/** What a drag of the handles in 3D does. */
export type MoveMode = 'translate' | 'rotate' | 'scale';

export interface MoveDraft {
  readonly kind: 'move';
  /** Whether a copy is moved. */
  readonly copy: boolean;
  readonly mode: MoveMode;
  /** Scene units. */
  readonly pivot: Triple;
  readonly move: Move;
}

export interface RecolorDraft {
  readonly kind: 'recolor';
  /** "#rrggbb". */
  readonly color: string;
  /** Share of the new colour, in (0, 1]. */
  readonly strength: number;
  /** Mean luminance of the Gaussians, which get the colour on average. */
  readonly luminance: number;
}

export type Draft = MoveDraft | RecolorDraft;

export type DraftedEdit = 'move' | 'copy' | 'recolor';

const firstColor = '#3b82f6';
/** What is black has no shades to keep. */
const minLuminance = 0.02;

/** Returns red, green and blue of "#rrggbb", from 0 to 1. */
export function colorOfText(text: string): Triple {
  const part = (at: number) => Number.parseInt(text.slice(at, at + 2), 16) / 255;
  return [part(1), part(3), part(5)];
}

/** Returns the mean luminance of the Gaussians of a set, by their opacities, as the server does. */
export function luminanceOfSet(set: GaussianSet, { luminances, opacities }: GaussianPly): number {
  let sum = 0;
  let weight = 0;
  for (let i = 0; i < set.length; ++i) {
    if (!set[i]) continue;
    sum += (opacities[i] as number) * (luminances[i] as number);
    weight += opacities[i] as number;
  }
  return Math.max(minLuminance, weight > 0 ? sum / weight : 0);
}

/** Returns the edit of a draft, as in EditModelRequest; undefined: it would change nothing. */
export function editOf(draft: Draft): EditRequest['edit'] | undefined {
  if (draft.kind === 'recolor') {
    const [red, green, blue] = colorOfText(draft.color);
    return { case: 'recolor', value: { red, green, blue, strength: draft.strength } };
  }
  if (!moves(draft.move)) return undefined;
  const { translation, rotation, scale } = draft.move;
  const vector = ([x, y, z]: Triple) => ({ x, y, z });
  return {
    case: 'move',
    value: {
      translation: vector(translation),
      rotation: rotationOf(rotation),
      scale,
      pivot: vector(draft.pivot),
      copy: draft.copy,
    },
  };
}

export class Drafting {
  /** Undefined: nothing is drafted. */
  readonly state = new Store<Draft | undefined>(undefined);
  private set: GaussianSet | undefined;

  /** A draft is about what is picked when it begins; other picks end it. */
  constructor(private readonly edits: GaussianEdits) {
    edits.state.follow(() => {
      if (edits.state.get().edits.picked !== this.set) this.end();
    });
  }

  /** Begins a draft with the picked Gaussians, which are loaded. */
  begin(kind: DraftedEdit): void {
    const { gaussians, numPicked, edits } = this.edits.state.get();
    if (!gaussians || numPicked === 0) return;
    this.set = edits.picked;
    if (kind === 'recolor') {
      const luminance = luminanceOfSet(edits.picked, gaussians);
      this.state.set({ kind, color: firstColor, strength: 1, luminance });
      return;
    }
    const pivot = middleOfSet(edits.picked, gaussians.centers);
    this.state.set({ kind: 'move', copy: kind === 'copy', mode: 'translate', pivot, move: noMove });
  }

  setMode(mode: MoveMode): void {
    const draft = this.state.get();
    if (draft?.kind === 'move') this.state.set({ ...draft, mode });
  }

  /** Moves the Gaussians to another place than before; its scale is kept within the limits. */
  moveTo(move: Partial<Move>): void {
    const draft = this.state.get();
    if (draft?.kind !== 'move') return;
    const next = { ...draft.move, ...move };
    const scale = Math.min(Math.max(next.scale, minScale), maxScale);
    this.state.set({ ...draft, move: { ...next, scale } });
  }

  recolor(change: Partial<Pick<RecolorDraft, 'color' | 'strength'>>): void {
    const draft = this.state.get();
    if (draft?.kind === 'recolor') this.state.set({ ...draft, ...change });
  }

  end(): void {
    this.set = undefined;
    this.state.set(undefined);
  }
}
