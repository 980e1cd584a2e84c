// The layout of a scene's screen: panes, side panel, zoom and 3D view.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { noFindings } from './on_screen';

/** Returns the share of the window that an element covers. */
async function shareOf(page: Page, selector: string): Promise<number> {
  const box = await page.locator(selector).boundingBox();
  const { width = 0, height = 0 } = page.viewportSize() ?? {};
  return ((box?.width ?? 0) * (box?.height ?? 0)) / (width * height);
}

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testLayout(shared: () => { readonly page: Page }): void {
  test('the keys 1, 2, 3 show the photograph, both and 3D', async () => {
    const { page } = shared();
    const [stage, splats] = [page.locator('.stage'), page.locator('.splats')];
    await page.keyboard.press('Escape');
    await page.locator('.picture').focus();
    await page.keyboard.press('1');
    await expect(splats).toBeHidden();
    expect(await shareOf(page, '.picture')).toBeGreaterThan(0.55);
    const scroll = await page.evaluate(() => document.documentElement.scrollHeight);
    expect(scroll, 'the page does not scroll').toBe(900);
    await noFindings(page);
    await page.keyboard.press('3');
    await expect(stage).toBeHidden();
    expect(await shareOf(page, '.splats')).toBeGreaterThan(0.55);
    await noFindings(page);
    await page.reload();
    await expect(splats).toBeVisible();
    await expect(stage).toBeHidden();
    expect(page.url()).toContain('show=3d');
    await page.keyboard.press('2');
    await expect(stage).toBeVisible();
    expect(await shareOf(page, '.stage')).toBeCloseTo(await shareOf(page, '.splats'), 2);
    await noFindings(page);
  });

  test('the side panel folds into a rail that keeps the tools', async () => {
    const { page } = shared();
    const before = await shareOf(page, '.panes');
    await page.keyboard.press('p');
    await expect(page.getByRole('heading', { name: 'Find' })).toBeHidden();
    expect(await shareOf(page, '.panes')).toBeGreaterThan(before * 1.2);
    await page.getByRole('button', { name: 'Exclude' }).click();
    await noFindings(page);
    await page.keyboard.press('/');
    await expect(page.getByLabel('Find by a word')).toBeFocused();
    await page.getByRole('button', { name: 'Side panel' }).click();
    await expect(page.getByLabel('Find by a word')).toBeHidden();
    await page.keyboard.press('p');
    await page.getByRole('button', { name: 'Include' }).click();
    await expect(page.getByRole('heading', { name: 'Find' })).toBeVisible();
  });
}
