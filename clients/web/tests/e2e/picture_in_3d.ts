// The picture of the 3D view, and how much two of them differ.
import type { Page } from '@playwright/test';
import { expect } from '@playwright/test';

/** Waits for the 3D view, and returns its picture, shrunk to 32x32 grey pixels from 0 to 255. */
export async function pictureIn3d(page: Page): Promise<number[]> {
  await expect(page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
  await page.waitForTimeout(2500); // for Spark to sort
  return page.locator('.splats-canvas').evaluate((canvas) => {
    const small = new OffscreenCanvas(32, 32);
    const context = small.getContext('2d') as OffscreenCanvasRenderingContext2D;
    context.drawImage(canvas as HTMLCanvasElement, 0, 0, 32, 32);
    const { data } = context.getImageData(0, 0, 32, 32);
    return Array.from({ length: 32 * 32 }, (_, i) => data[4 * i + 1] as number);
  });
}

/** Returns the mean difference of their pixels. */
export function difference(a: readonly number[], b: readonly number[]): number {
  return a.reduce((sum, value, i) => sum + Math.abs(value - (b[i] as number)), 0) / a.length;
}
