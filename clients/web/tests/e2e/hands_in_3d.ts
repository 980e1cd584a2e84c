// What a person does in the 3D view, and sees there.
import type { Page } from '@playwright/test';

/** Positions are shares of the 3D view's width and height. */
export type Spot = readonly [number, number];

/** Drags over the 3D view, with a key held. */
export async function dragIn3d(page: Page, path: readonly Spot[], held?: 'Shift' | 'Alt'): Promise<void> {
  const edges = await page.locator('.splats-canvas').boundingBox();
  if (!edges) throw new Error('no 3D view');
  if (held) await page.keyboard.down(held);
  for (const [i, [x, y]] of path.entries()) {
    const steps = i === 0 ? 1 : 5;
    await page.mouse.move(edges.x + x * edges.width, edges.y + y * edges.height, { steps });
    if (i === 0) await page.mouse.down();
  }
  await page.mouse.up();
  if (held) await page.keyboard.up(held);
}

/** Returns the colour of the 3D view's picture around a position, each from 0 to 255. */
export async function colorIn3d(page: Page, [x, y]: Spot): Promise<{ r: number; g: number; b: number }> {
  await page.waitForTimeout(1500); // for Spark to sort
  return page.locator('.splats-canvas').evaluate(
    (canvas, at) => {
      const one = new OffscreenCanvas(1, 1);
      const context = one.getContext('2d') as OffscreenCanvasRenderingContext2D;
      const { width, height } = canvas as HTMLCanvasElement;
      const side = 8;
      const corner = [at[0] * width - side / 2, at[1] * height - side / 2] as const;
      context.drawImage(canvas as HTMLCanvasElement, ...corner, side, side, 0, 0, 1, 1);
      const [r = 0, g = 0, b = 0] = context.getImageData(0, 0, 1, 1).data;
      return { r, g, b };
    },
    [x, y] as const,
  );
}

/** Chooses what the files of Gaussians are of. */
export async function exportedPart(page: Page, title: string): Promise<void> {
  await page.getByRole('combobox', { name: 'Of', exact: true }).selectOption(title);
}
