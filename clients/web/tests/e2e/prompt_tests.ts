// Boxes, points and strokes, by mouse and by keyboard.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { clickView, dragBox, drawStroke, numSizes, picturesOf } from './on_screen';

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testPrompts(shared: () => { readonly page: Page }): void {
  test('a box, a point, an excluded point and undo change the segment', async () => {
    const { page } = shared();
    const area = async () => Number(await page.locator('.picture').getAttribute('data-area'));
    await page.keyboard.press('Escape');
    await expect.poll(area).toBe(0);
    // A box around the tissue box.
    await dragBox(page, [0.54, 0.52], [0.77, 0.84]);
    const drawn = 0.23 * 0.32 * 640 * 480;
    await expect.poll(area, { timeout: 30_000 }).toBeGreaterThan(0.5 * drawn);
    const boxArea = await area();
    expect(boxArea).toBeLessThan(1.3 * drawn);

    await clickView(page, [0.37, 0.6]);
    await numSizes(page);
    const included = await area();
    expect(included).toBeGreaterThan(0);
    await clickView(page, [0.34, 0.45], true);
    await expect(page.locator('.mark.negative')).toHaveCount(1);
    await expect.poll(area, { timeout: 30_000 }).toBeLessThan(included);
    await page.keyboard.press('Control+z');
    await expect(page.locator('.mark.negative')).toHaveCount(0);
    await expect.poll(area, { timeout: 30_000 }).toBe(included);
    await page.keyboard.press('Control+z');
    await expect(page.locator('.mark-box')).toHaveCount(1);
    await expect.poll(area, { timeout: 30_000 }).toBe(boxArea);
  });

  test('strokes segment what they are over, by mouse and by keyboard', async () => {
    const { page } = shared();
    const area = async () => Number(await page.locator('.picture').getAttribute('data-area'));
    await page.keyboard.press('Escape');
    await expect.poll(area).toBe(0);
    await page.getByRole('button', { name: 'Brush' }).click();
    // Over the tissue box, then a corner of the shelf is left out.
    const box = 0.23 * 0.32 * 640 * 480;
    await drawStroke(page, [
      [0.58, 0.62],
      [0.63, 0.75],
      [0.68, 0.62],
    ]);
    await expect(page.locator('.stroke')).toHaveCount(1);
    await expect.poll(area, { timeout: 30_000 }).toBeGreaterThan(0.4 * box);
    const drawn = await area();
    await drawStroke(
      page,
      [
        [0.45, 0.42],
        [0.5, 0.5],
      ],
      true,
    );
    await expect(page.locator('.stroke.negative')).toHaveCount(1);
    await expect.poll(area, { timeout: 30_000 }).toBeGreaterThan(0.4 * box);
    expect(await area()).toBeLessThan(1.5 * box);
    await picturesOf(page, 'scene-brush');
    await page.keyboard.press('Control+z');
    await expect(page.locator('.stroke.negative')).toHaveCount(0);
    await expect.poll(area, { timeout: 30_000 }).toBe(drawn);

    await page.keyboard.press('Escape');
    await expect.poll(area).toBe(0);
    await page.locator('.picture').focus();
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('Enter');
    await expect(page.getByText('Arrow keys draw.')).toBeVisible();
    for (const key of ['ArrowRight', 'ArrowRight', 'ArrowRight', 'ArrowDown']) {
      await page.keyboard.press(key);
    }
    await page.keyboard.press('Escape'); // drops the stroke
    await expect(page.locator('.stroke')).toHaveCount(0);
    for (const key of ['Enter', 'ArrowDown', 'ArrowDown', 'Enter']) await page.keyboard.press(key);
    await expect(page.locator('.stroke')).toHaveCount(1);
    await expect.poll(area, { timeout: 30_000 }).toBeGreaterThan(0);
    await page.keyboard.press('Escape');
    await page.getByRole('button', { name: 'Include' }).click();
  });
}
