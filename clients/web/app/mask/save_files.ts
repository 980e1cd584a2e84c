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

/** Saves a ZIP with a folder for each label, a PNG for each view, and labels.json. */
export async function saveMasks(scene: string, segments: readonly ViewMasks[]): Promise<void> {
  const files: Record<string, Uint8Array> = { 'labels.json': strToU8(labelsJson(segments)) };
  for (const { path, rle } of maskFiles(segments)) {
    const png = await maskPng(rle);
    files[path] = new Uint8Array(await png.arrayBuffer());
  }
  // PNGs are compressed already.
  const zip = zipSync(files, { level: 0 });
  saveBlob(
    new Blob([zip as Uint8Array<ArrayBuffer>], { type: 'application/zip' }),
    `${scene}-masks.zip`,
  );
}
