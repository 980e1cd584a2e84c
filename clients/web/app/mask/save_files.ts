// Files that the browser saves.
import { strToU8, zipSync } from 'fflate';
import type { CocoView, ViewMasks } from './coco';
import { cocoJson } from './coco';
import { labelsJson, maskFiles } from './mask_files';
import { maskPng } from './paint';

export function saveBlob(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

export function saveCoco(
  scene: string,
  views: readonly CocoView[],
  segments: readonly ViewMasks[],
): void {
  const text = JSON.stringify(cocoJson(scene, views, segments), undefined, 1);
  saveBlob(new Blob([text], { type: 'application/json' }), `${scene}-coco.json`);
}

/**
 * Saves a ZIP with a folder for each label, a PNG for each view, and labels.json. `progress` is called
 * with the number of PNGs that are written, and may throw to end it.
 */
export async function saveMasks(
  scene: string,
  segments: readonly ViewMasks[],
  progress: (done: number, total: number) => void,
): Promise<void> {
  const files: Record<string, Uint8Array> = { 'labels.json': strToU8(labelsJson(segments)) };
  const pngs = maskFiles(segments);
  for (const [i, { path, rle }] of pngs.entries()) {
    progress(i, pngs.length);
    const png = await maskPng(rle);
    files[path] = new Uint8Array(await png.arrayBuffer());
  }
  progress(pngs.length, pngs.length);
  // PNGs are compressed already.
  const zip = zipSync(files, { level: 0 });
  saveBlob(
    new Blob([zip as Uint8Array<ArrayBuffer>], { type: 'application/zip' }),
    `${scene}-masks.zip`,
  );
}
