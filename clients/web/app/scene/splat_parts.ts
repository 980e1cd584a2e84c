// The files of Gaussians that the 3D view draws, and their colours.
import { plyUrl } from '../api/clients';
import type { SplatPart } from '../viewer/splat_viewer';
import { selectionTint } from '../viewer/tint';
import type { Rgb } from './found_things';
import type { Showing } from './selections';

/** Named things in 3D: their selections, and that of all of them. */
export interface TintedThings {
  readonly all: string;
  /** Without a colour a thing is drawn as it is. */
  readonly parts: readonly { readonly selection: string; readonly color: Rgb | undefined }[];
}

/** Returns the factors that give Gaussians a colour, but leave light and dark. */
function tintOf(color: Rgb): readonly [number, number, number] {
  const factor = (value: number) => 0.2 + (1.4 * value) / 255;
  return [factor(color[0]), factor(color[1]), factor(color[2])];
}

/** A selection that is shown comes before things in their colours. */
export function splatParts(
  model: string,
  selection: string | undefined,
  showing: Showing,
  things: TintedThings | undefined,
): SplatPart[] {
  if (selection && showing !== 'all') {
    const tint = showing === 'tinted' ? selectionTint : undefined;
    const chosen = { url: plyUrl(model, { selection }), tint };
    const rest = { url: plyUrl(model, { selection, complement: true }) };
    if (showing === 'isolated') return [chosen];
    return showing === 'hidden' ? [rest] : [rest, chosen];
  }
  if (!things) return [{ url: plyUrl(model) }];
  return [
    { url: plyUrl(model, { selection: things.all, complement: true }) },
    ...things.parts.map(({ selection: part, color }) => ({
      url: plyUrl(model, { selection: part }),
      tint: color && tintOf(color),
    })),
  ];
}
