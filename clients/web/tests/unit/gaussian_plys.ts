// PLYs of Gaussians, as the server writes them.

export interface Gaussian {
  readonly center: readonly [number, number, number];
  /** Largest standard deviation. */
  readonly size?: number;
  readonly opacity?: number;
}

/** `isDouble`: positions are far from zero. */
export function plyWith(gaussians: readonly Gaussian[], isDouble = false): ArrayBuffer {
  const number = isDouble ? 'double' : 'float';
  const header = [
    'ply',
    'format binary_little_endian 1.0',
    `element vertex ${gaussians.length}`,
    ...['x', 'y', 'z'].map((name) => `property ${number} ${name}`),
    ...[0, 1, 2].map((color) => `property float f_dc_${color}`),
    'property float opacity',
    ...[0, 1, 2].map((axis) => `property float scale_${axis}`),
    'end_header',
    '',
  ].join('\n');
  const text = new TextEncoder().encode(header);
  const stride = (isDouble ? 24 : 12) + 7 * 4;
  const bytes = new Uint8Array(text.length + stride * gaussians.length);
  bytes.set(text);
  const view = new DataView(bytes.buffer, text.length);
  gaussians.forEach(({ center, size = 0.01, opacity = 0.9 }, i) => {
    let at = i * stride;
    for (const value of center) {
      if (isDouble) view.setFloat64(at, value, true);
      else view.setFloat32(at, value, true);
      at += isDouble ? 8 : 4;
    }
    const logit = Math.log(opacity / (1 - opacity));
    const rest = [i, 0, 0, logit, Math.log(size), Math.log(size / 2), -20];
    for (const [k, value] of rest.entries()) view.setFloat32(at + 4 * k, value, true);
  });
  return bytes.buffer;
}
