// Where the 3D view's camera is, as text for the address.

type Triple = readonly [number, number, number];

export interface CameraPlace {
  readonly position: Triple;
  /** The point that the camera looks at, about which it turns. */
  readonly target: Triple;
  /** Halves of what is seen at a distance of 1. */
  readonly lens: { readonly across: number; readonly up: number };
}

/** Significant digits of distances; positions have as many decimals as that takes. */
const digits = 5;

export function placeText({ position, target, lens }: CameraPlace): string {
  const distance = Math.hypot(...position.map((value, i) => value - (target[i] as number)));
  const size = Math.floor(Math.log10(distance || 1));
  const decimals = Math.min(Math.max(digits - 1 - size, 0), 12);
  const places = [...position, ...target].map((value) => Number(value.toFixed(decimals)));
  const lenses = [lens.across, lens.up].map((value) => Number(value.toPrecision(digits)));
  return [...places, ...lenses].join(',');
}

/** Returns the place that a text says; undefined if it says none. */
export function readPlace(text: string | undefined): CameraPlace | undefined {
  const values = (text ?? '').split(',').map((value) => (value === '' ? NaN : Number(value)));
  if (values.length !== 8 || !values.every(Number.isFinite)) return undefined;
  const [px, py, pz, tx, ty, tz, across, up] = values as [
    ...[number, number, number, number, number, number, number, number],
  ];
  const isSame = px === tx && py === ty && pz === tz;
  if (across <= 0 || up <= 0 || isSame) return undefined;
  return { position: [px, py, pz], target: [tx, ty, tz], lens: { across, up } };
}
