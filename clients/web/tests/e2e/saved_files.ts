// Files that the page saves, and a dataset made from them.
import { cpSync, mkdtempSync, readFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Locator, Page } from '@playwright/test';
import { strFromU8, unzipSync } from 'fflate';
import { shelf } from './stack';

/** Clicks on `link` and returns the path of the saved file. */
export async function saved(page: Page, link: Locator): Promise<string> {
  const download = page.waitForEvent('download');
  await link.click();
  return (await download).path();
}

export function numGaussians(ply: string): number {
  const head = readFileSync(ply).subarray(0, 400).toString('latin1');
  return Number(/element vertex (\d+)/.exec(head)?.[1]);
}

export interface Coco {
  images: unknown[];
  categories: { id: number; name: string }[];
  annotations: { image_id: number; category_id: number; area: number }[];
}

export function readCoco(file: string): Coco {
  return JSON.parse(readFileSync(file, 'utf8')) as Coco;
}

/** Returns the files of a zip, by their paths. */
export function unzipped(zip: string): ReadonlyMap<string, Uint8Array> {
  return new Map(Object.entries(unzipSync(readFileSync(zip))));
}

/** Returns a file of a zip as text; fails if it is not there. */
export function textIn(files: ReadonlyMap<string, Uint8Array>, path: string): string {
  const bytes = files.get(path);
  if (!bytes) throw new Error(`no ${path} among ${[...files.keys()].join(', ')}`);
  return strFromU8(bytes);
}

/** Makes a folder with the shelf's photographs, and Gaussians in place of a reconstruction. */
export function shelfWith(ply: string): string {
  const folder = mkdtempSync(join(tmpdir(), 'pepeseg-ply-'));
  for (const part of ['images', 'sparse', 'masks']) {
    cpSync(join(shelf, part), join(folder, part), { recursive: true });
  }
  cpSync(ply, join(folder, 'gaussians.ply'));
  return folder;
}
