// The lasso, and changes of a mask by hand.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { drawStroke, noFindings, overlayIou, picturesOf, screenshot, truthOf } from './on_screen';

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testMasks(shared: () => { readonly page: Page }): void {
  const area = async (page: Page) =>
    Number(await page.locator('.picture').getAttribute('data-area'));
  const seen = (page: Page) =>
    expect(page.getByText(/Seen in \d+ views?\./)).toBeVisible({ timeout: 60_000 });

  test('an outline drawn around the book segments it', async () => {
    const { page } = shared();
    await page.keyboard.press('Escape');
    await expect.poll(() => area(page)).toBe(0);
    const view = (await page.locator('.picture').getAttribute('data-view')) ?? '';
    const book = await truthOf(page, view, 114);
    await page.getByRole('button', { name: 'Lasso', exact: true }).click();
    await drawStroke(page, [
      [0.24, 0.32],
      [0.34, 0.34],
      [0.44, 0.4],
      [0.5, 0.85],
      [0.32, 0.9],
      [0.28, 0.6],
    ]);
    await expect.poll(() => area(page), { timeout: 30_000 }).toBeGreaterThan(0);
    await seen(page);
    const iou = await overlayIou(page, book);
    console.log(`IoU of the lasso around the book: ${iou.toFixed(3)}`);
    expect(iou).toBeGreaterThan(0.75);
    await noFindings(page);
  });

  test('what is painted and erased stays as it is, also under a name', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const first = await area(page);
    await page.getByRole('button', { name: 'Paint' }).click();
    await drawStroke(page, [
      [0.6, 0.75],
      [0.7, 0.7],
    ]);
    // 8 pixels wide, 64 and 24 pixels long in the directions of width and height.
    const stroke = Math.hypot(64, 24) * 8 + Math.PI * 16;
    await expect.poll(() => area(page)).toBeGreaterThan(first);
    const painted = await area(page);
    expect((painted - first) / stroke).toBeGreaterThan(0.85);
    expect((painted - first) / stroke).toBeLessThan(1.15);
    await seen(page);
    expect(await area(page)).toBe(painted);
    await page.getByRole('button', { name: 'Erase' }).click();
    await drawStroke(page, [
      [0.36, 0.5],
      [0.4, 0.6],
    ]);
    await expect.poll(() => area(page)).toBeLessThan(painted);
    const erased = await area(page);
    await seen(page);
    expect(await area(page)).toBe(erased);
    await picturesOf(page, 'scene-paint');

    // The stroke on the other thing is a piece of its own.
    await page.getByRole('button', { name: 'Largest piece' }).click();
    await expect.poll(() => area(page)).toBeLessThan(erased - 0.85 * stroke);
    const largest = await area(page);
    await seen(page);
    await page.getByRole('button', { name: 'Drop small pieces' }).click();
    await expect(page.getByText('The mask has no small pieces.')).toBeVisible();
    await screenshot(page, 'scene-largest-piece');
    await page.keyboard.press('Control+z');
    await expect.poll(() => area(page), { timeout: 30_000 }).toBe(erased);
    await page.getByRole('button', { name: 'Largest piece' }).click();
    await expect.poll(() => area(page)).toBe(largest);
    await seen(page);

    await page.getByLabel('Name of the segment').fill('Painted');
    await page.getByRole('button', { name: 'Name', exact: true }).click();
    const named = page.getByRole('button', { name: 'Painted', exact: true });
    await expect(named).toBeVisible();
    await named.click();
    await expect.poll(() => area(page), { timeout: 30_000 }).toBe(largest);
    await seen(page);
    expect(await area(page)).toBe(largest);
    await page.getByRole('button', { name: 'Delete the label Painted' }).click();
    await page.getByText('Delete?').click();
    await expect(named).toHaveCount(0);
    await page.keyboard.press('Escape');
    await page.getByRole('button', { name: 'Include' }).click();
  });
}
