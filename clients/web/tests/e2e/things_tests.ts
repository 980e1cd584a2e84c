// Named things in their colours, several at once.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { noFindings, picturesOf, placeIn3d, shownInSplats } from './on_screen';

type Rgba = readonly [number, number, number, number];

/** Returns a pixel of a canvas, at shares of its width and height. */
function pixelOf(page: Page, selector: string, at: readonly [number, number]): Promise<Rgba> {
  return page.locator(selector).evaluate((element, [x, y]) => {
    const canvas = element as HTMLCanvasElement;
    const copy = new OffscreenCanvas(canvas.width, canvas.height);
    const context = copy.getContext('2d') as OffscreenCanvasRenderingContext2D;
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(x * canvas.width, y * canvas.height, 1, 1);
    return [data[0], data[1], data[2], data[3]] as unknown as Rgba;
  }, at);
}

/** Adds the tests. `shared` returns the page, with a scene that has a bunny book and a tissue box. */
export function testThings(shared: () => { readonly page: Page }): void {
  const book = [0.34, 0.62] as const;
  const tissueBox = [0.65, 0.68] as const;

  test('several things are shown at once, each in its colour', async () => {
    const { page } = shared();
    const picture = page.locator('.picture');
    const count = await page.locator('.things li').count();
    await page.keyboard.press('Escape');
    await expect(picture).toHaveAttribute('data-things', `${count}`, { timeout: 60_000 });
    const alphaAt = async (at: readonly [number, number]) =>
      (await pixelOf(page, 'canvas.things-layer', at))[3];
    expect(await alphaAt(book)).toBeGreaterThan(0);
    expect(await alphaAt(tissueBox)).toBeGreaterThan(0);
    const [bookColor, boxColor] = [
      await pixelOf(page, 'canvas.things-layer', book),
      await pixelOf(page, 'canvas.things-layer', tissueBox),
    ];
    expect(bookColor).not.toEqual(boxColor);
    await picturesOf(page, 'scene-things');
    await page.getByRole('button', { name: 'Show Tissue box' }).click();
    await expect(picture).toHaveAttribute('data-things', `${count - 1}`);
    // The layer is painted after the frame that has the attribute.
    await expect.poll(() => alphaAt(tissueBox)).toBe(0);
    expect(await alphaAt(book)).toBeGreaterThan(0);
    await page.getByRole('button', { name: 'Show Tissue box' }).click();
    await expect(picture).toHaveAttribute('data-things', `${count}`);
    await page.locator('.picture').focus();
    await page.keyboard.press('n');
    await expect(picture).toHaveAttribute('data-things', '0');
    await page.keyboard.press('n');
    await expect(picture).toHaveAttribute('data-things', `${count}`);
    await noFindings(page);
  });

  test('things have their colours in 3D', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const count = await page.locator('.things li').count();
    await page.keyboard.press('2');
    await page.keyboard.press('b');
    await shownInSplats(page, 'all');
    const pane = await page.locator('.splats').boundingBox();
    if (!pane) throw new Error('no 3D view');
    const at = await placeIn3d(page, tissueBox);
    const shares = [(at.x - pane.x) / pane.width, (at.y - pane.y) / pane.height] as const;
    const plain = await pixelOf(page, '.splats-canvas', shares);
    const button = page.getByRole('button', { name: 'Things coloured in 3D' });
    await button.click();
    await expect(page.getByText(/^Selecting: \d of \d …$/)).toBeVisible();
    const splats = page.locator('.splats');
    await expect(splats).toHaveAttribute('data-things', /[1-9]/, { timeout: 120_000 });
    expect(Number(await splats.getAttribute('data-things'))).toBeLessThanOrEqual(count);
    await shownInSplats(page, 'all');
    const coloured = await pixelOf(page, '.splats-canvas', shares);
    const change = Math.max(...plain.map((value, i) => Math.abs(value - (coloured[i] as number))));
    expect(change, 'the tissue box has another colour').toBeGreaterThan(20);
    await noFindings(page);
    await button.click();
    await expect(splats).toHaveAttribute('data-things', '0', { timeout: 60_000 });
    await shownInSplats(page, 'all');
    expect(await pixelOf(page, '.splats-canvas', shares)).toEqual(plain);
  });
}
