// The Gaussians of a file in the 3D view, each of which can be drawn as picked or not at all.
import { RgbaArray, SplatFileType, SplatMesh, dyno, readRgbaArray } from '@sparkjsdev/spark';
import { Color, Vector4 } from 'three';
import type { Vector3 } from 'three';
import type { Triple } from '../gaussians/crop_box';
import { centersOf, indicesIn } from '../gaussians/gaussian_ply';
import type { GaussianSet } from '../gaussians/gaussian_set';
import type { Tint } from './tint';
import { selectionTint } from './tint';

/** Another colour for Gaussians; light and dark stay. */
export interface NewColor {
  /** Red, green and blue, from 0 to 1. */
  readonly color: Triple;
  /** Share of the new colour, from 0 to 1. */
  readonly strength: number;
  /** Mean luminance of the Gaussians, above 0. They get the colour on average. */
  readonly luminance: number;
}

/** How the Gaussians of a model are drawn. */
export interface Marks {
  /** Name of the model. */
  readonly model: string;
  /** x, y, z of each Gaussian of the model. */
  readonly centers: Float32Array;
  readonly picked: GaussianSet;
  readonly hidden: GaussianSet;
  /** Colour of what is picked; undefined: tinted. */
  readonly newColor: NewColor | undefined;
}

/** Maximum number of Gaussians by which the scene's size is estimated. */
const maxSampled = 20_000;
const tintText = `vec3(${selectionTint.map((factor) => factor.toFixed(2)).join(', ')})`;

/** Red, green and blue by which luminance is multiplied, and the share of that colour. */
const paintOf = () => dyno.dynoVec4(new Vector4());

/** Returns a modifier of Spark: red marks what is tinted, green what is hidden, blue what is painted. */
function modifierOf(marks: RgbaArray, paint: ReturnType<typeof paintOf>) {
  return dyno.dynoBlock({ gsplat: dyno.Gsplat }, { gsplat: dyno.Gsplat }, ({ gsplat }) => {
    if (!gsplat) throw new Error('no Gaussian to modify');
    const mark = readRgbaArray(marks.dyno, dyno.splitGsplat(gsplat).outputs.index);
    const { outputs } = new dyno.Dyno({
      inTypes: { gsplat: dyno.Gsplat, mark: 'vec4', paint: 'vec4' },
      outTypes: { gsplat: dyno.Gsplat },
      inputs: { gsplat, mark, paint },
      statements: ({ inputs, outputs: to }) => [
        `${to.gsplat} = ${inputs.gsplat};`,
        `${to.gsplat}.rgba.rgb *= mix(vec3(1.0), ${tintText}, ${inputs.mark}.r);`,
        `vec3 painted = ${inputs.paint}.rgb * dot(${to.gsplat}.rgba.rgb, vec3(0.2126, 0.7152, 0.0722));`,
        `${to.gsplat}.rgba.rgb = mix(${to.gsplat}.rgba.rgb, painted, ${inputs.paint}.a * ${inputs.mark}.b);`,
        `${to.gsplat}.rgba.a *= 1.0 - ${inputs.mark}.g;`,
      ],
    });
    return { gsplat: outputs.gsplat };
  });
}

export class MarkedSplats {
  private marks: RgbaArray | undefined;
  private readonly paint = paintOf();
  /** Indices in the model; undefined until they are needed. */
  private indices: Uint32Array | undefined;

  private constructor(
    readonly mesh: SplatMesh,
    private readonly centers: Float32Array,
  ) {}

  /** Returns the Gaussians of a PLY. */
  static async of(fileBytes: ArrayBuffer, tint: Tint | undefined): Promise<MarkedSplats> {
    const centers = await centersOf(fileBytes);
    const mesh = new SplatMesh({ fileBytes, fileType: SplatFileType.PLY });
    await mesh.initialized;
    if (tint) mesh.recolor = new Color(...tint);
    return new MarkedSplats(mesh, centers);
  }

  mark(marks: Marks): void {
    const indices = this.indicesIn(marks);
    if (!this.marks) {
      this.marks = new RgbaArray();
      this.marks.ensureCapacity(indices.length);
      this.marks.count = indices.length;
      this.mesh.objectModifier = modifierOf(this.marks, this.paint);
      this.mesh.updateGenerator();
    }
    const to = this.marks.array as Uint8Array;
    const { newColor } = marks;
    const [tinted, painted] = newColor ? [0, 255] : [255, 0];
    for (let i = 0; i < indices.length; ++i) {
      const index = indices[i] as number;
      to[4 * i] = marks.picked[index] ? tinted : 0;
      to[4 * i + 2] = marks.picked[index] ? painted : 0;
      to[4 * i + 1] = marks.hidden[index] ? 255 : 0;
    }
    if (newColor) {
      const { color, strength, luminance } = newColor;
      this.paint.value.set(...color, 0).divideScalar(luminance).setW(strength);
    }
    this.marks.needsUpdate = true;
    this.mesh.updateVersion();
  }

  /** Adds the Gaussians of this file to a set of the model's. */
  addTo(set: Uint8Array, marks: Marks): void {
    for (const index of this.indicesIn(marks)) set[index] = 1;
  }

  dispose(): void {
    this.marks?.dispose();
    this.mesh.dispose();
  }

  private indicesIn({ centers }: Marks): Uint32Array {
    return (this.indices ??= indicesIn(centers, this.centers));
  }
}

/** Returns the centres of some Gaussians, evenly spread over their order. */
export function sampledCenters(parts: readonly MarkedSplats[]): Vector3[] {
  const all = parts.flatMap(({ mesh }) => mesh.packedSplats ?? mesh.extSplats ?? []);
  const total = all.reduce((sum, { numSplats }) => sum + numSplats, 0);
  const step = Math.max(1, Math.ceil(total / maxSampled));
  return all.flatMap((splats) =>
    Array.from({ length: Math.floor(splats.numSplats / step) }, (_, i) =>
      splats.getSplat(i * step).center.clone(),
    ),
  );
}

/** Throws the server's error. */
export async function fetchPly(url: string, signal: AbortSignal): Promise<ArrayBuffer> {
  const response = await fetch(url, { signal });
  if (response.ok) return response.arrayBuffer();
  const body = (await response.json().catch(() => undefined)) as { message?: string } | undefined;
  throw new Error(body?.message ?? `the model's PLY: HTTP ${response.status}`);
}
