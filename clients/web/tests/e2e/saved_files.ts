// Files that the page saves, and a dataset made from them.
import { cpSync, mkdtempSync, readFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Locator, Page } from '@playwright/test';
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
  categories: { name: string }[];
  annotations: { image_id: number; area: number }[];
}

export function readCoco(file: string): Coco {
  return JSON.parse(readFileSync(file, 'utf8')) as Coco;
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
