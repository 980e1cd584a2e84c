// The layout of a scene's screen: panes, side panel, zoom and 3D view.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { clickView, noFindings, numAnswers, numSizes, screenshot, settled } from './on_screen';
import { difference, pictureIn3d } from './picture_in_3d';

/** Returns the share of the window that an element covers. */
async function shareOf(page: Page, selector: string): Promise<number> {
  const box = await page.locator(selector).boundingBox();
  const { width = 0, height = 0 } = page.viewportSize() ?? {};
  return ((box?.width ?? 0) * (box?.height ?? 0)) / (width * height);
}

interface Clicked {
  /** Pixel of the photograph. */
  readonly x: number;
  readonly y: number;
  /** Pixels of the answer. */
  readonly area: number;
}

/** Clicks at shares of the photograph's width and height; returns what the app made of it. */
async function clicked(page: Page, at: readonly [number, number]): Promise<Clicked> {
  await page.keyboard.press('Escape');
  await expect(page.locator('.mark')).toHaveCount(0);
  const before = await numAnswers(page);
  await clickView(page, at);
  await settled(page, before);
  await numSizes(page);
  const [x, y] = await page.locator('.mark').evaluate((mark) => {
    const { e, f } = (mark as SVGGElement).transform.baseVal.consolidate()?.matrix ?? { e: 0, f: 0 };
    const drawing = mark.closest('svg')?.viewBox.baseVal;
    const photo = mark.closest('.picture')?.querySelector('img')?.getAttribute('width');
    return [e, f].map((value) => (value / (drawing?.width ?? 1)) * Number(photo));
  });
  const area = Number(await page.locator('.picture').getAttribute('data-area'));
  return { x: Number(x), y: Number(y), area };
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

  test('a click in the zoomed and moved photograph segments the same pixel', async () => {
    const { page } = shared();
    const picture = page.locator('.picture');
    const [width, height] = await picture
      .locator('img')
      .evaluate((image) => ['width', 'height'].map((side) => Number(image.getAttribute(side))));
    if (!width || !height) throw new Error('a photograph without a size');
    const plain = await clicked(page, [0.37, 0.6]);
    const edges = await picture.boundingBox();
    if (!edges) throw new Error('no view on the screen');
    await page.mouse.move(edges.x + 0.3 * edges.width, edges.y + 0.5 * edges.height);
    while (Number(await picture.getAttribute('data-zoom')) < 4) {
      await page.mouse.wheel(0, -100);
      await page.waitForTimeout(50);
    }
    expect(Number(await picture.getAttribute('data-zoom'))).toBeLessThan(5);
    const area = await picture.getAttribute('data-area');
    expect(Number(area), 'the mask stays').toBe(plain.area);
    // By Space, which is not for the tool that was clicked last, and by the middle button.
    const zoomed = await picture.boundingBox();
    await page.getByRole('button', { name: 'Include' }).click();
    await page.mouse.move(edges.x + 0.3 * edges.width, edges.y + 0.5 * edges.height);
    await page.keyboard.down(' ');
    await page.mouse.down();
    await page.mouse.move(edges.x + 0.3 * edges.width - 40, edges.y + 0.5 * edges.height - 20);
    await page.mouse.up();
    await page.keyboard.up(' ');
    await page.mouse.down({ button: 'middle' });
    await page.mouse.move(edges.x + 0.3 * edges.width - 60, edges.y + 0.5 * edges.height - 20);
    await page.mouse.up({ button: 'middle' });
    const moved = await picture.boundingBox();
    expect((moved?.x ?? 0) - (zoomed?.x ?? 0)).toBeCloseTo(-60, 0);
    expect((moved?.y ?? 0) - (zoomed?.y ?? 0)).toBeCloseTo(-20, 0);
    await expect(page.locator('.mark-box')).toHaveCount(0);
    const pixel = { x: Math.floor(plain.x), y: Math.floor(plain.y) };
    const near = await clicked(page, [(pixel.x + 0.5) / width, (pixel.y + 0.5) / height]);
    expect({ x: Math.floor(near.x), y: Math.floor(near.y) }).toEqual(pixel);
    expect(near.area / plain.area).toBeCloseTo(1, 1);
    await screenshot(page, 'scene-zoomed');
    await noFindings(page);

    // Another photograph begins at the smallest scale.
    await page.keyboard.press(']');
    await expect(picture).toHaveAttribute('data-zoom', '1.00');
    await page.keyboard.press('[');
    await page.keyboard.press('+');
    await expect(picture).toHaveAttribute('data-zoom', '1.50');
    await page.keyboard.press('0');
    await expect(picture).toHaveAttribute('data-zoom', '1.00');
    await page.keyboard.press('Escape');
  });

  test('a drag does not lose the scene in 3D, and keys lead back', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const canvas = page.locator('.splats-canvas');
    await expect(page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
    const edges = await canvas.boundingBox();
    if (!edges) throw new Error('no 3D view');
    const [x, y] = [edges.x + edges.width / 2, edges.y + edges.height / 2];
    await page.keyboard.press('b');
    const first = await pictureIn3d(page);
    // Far away, and to the side.
    await page.mouse.move(x, y);
    for (let i = 0; i < 3; ++i) await page.mouse.wheel(0, 4000);
    for (let i = 0; i < 3; ++i) {
      await page.mouse.move(x - 200, y);
      await page.mouse.down({ button: 'right' });
      await page.mouse.move(x + 200, y);
      await page.mouse.up({ button: 'right' });
    }
    const far = await pictureIn3d(page);
    expect(far.filter((grey) => grey > 24).length, 'pixels of the scene').toBeGreaterThan(20);
    await screenshot(page, 'scene-3d-far');
    await page.keyboard.press('h');
    const home = await pictureIn3d(page);
    expect(difference(home, far)).toBeGreaterThan(2);
    await screenshot(page, 'scene-3d-home');
    await page.getByRole('button', { name: 'This view' }).click();
    expect(difference(await pictureIn3d(page), first)).toBeLessThan(2);

    await page.mouse.dblclick(x + 60, y + 60);
    expect(difference(await pictureIn3d(page), first)).toBeGreaterThan(2);
    await expect(page.locator('.mark')).toHaveCount(0);
    await expect(page.locator('.picture')).toHaveAttribute('data-area', '0');
    await page.keyboard.press('b');
    expect(difference(await pictureIn3d(page), first)).toBeLessThan(2);
  });
}
