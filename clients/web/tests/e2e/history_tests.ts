// Undo and redo of what a person did: clicks, and names that the server has.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { clickView, numAnswers, numSizes, settled } from './on_screen';

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testHistory(shared: () => { readonly page: Page }): void {
  test('a name is undone with its segment, and given again', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const undo = page.getByRole('button', { name: 'Undo' });
    const redo = page.getByRole('button', { name: 'Redo' });
    const area = async () => Number(await page.locator('.picture').getAttribute('data-area'));
    await page.keyboard.press('Escape');
    const before = await numAnswers(page);
    await clickView(page, [0.37, 0.6]);
    await settled(page, before);
    await numSizes(page);
    const clicked = await area();
    expect(clicked).toBeGreaterThan(0);
    await expect(undo).toHaveAttribute('title', 'Undo: Click (Ctrl+Z)');
    await page.getByPlaceholder('Name this segment').fill('Passing');
    await page.getByRole('button', { name: 'Name', exact: true }).click();
    const thing = page.getByRole('button', { name: 'Passing', exact: true });
    await expect(thing).toBeVisible();
    await expect(undo).toHaveAttribute('title', 'Undo: Name “Passing” (Ctrl+Z)');

    await page.locator('.picture').focus();
    await page.keyboard.press('Control+z');
    await expect(thing).toHaveCount(0);
    await expect.poll(area, { timeout: 30_000 }).toBe(clicked);
    await expect(redo).toHaveAttribute('title', 'Redo: Name “Passing” (Ctrl+Shift+Z)');
    await redo.click();
    await expect(thing).toBeVisible();
    expect(await area()).toBe(0);

    // Its deletion is undone, too.
    await page.getByRole('button', { name: 'Delete the label Passing' }).click();
    await page.getByRole('button', { name: 'Delete?' }).click();
    await expect(thing).toHaveCount(0);
    await undo.click();
    await expect(thing).toBeVisible();
    await redo.click();
    await expect(thing).toHaveCount(0);
  });
}
