// What a link shows: the view, the tools and the 3D camera; and the photographs' cameras in 3D.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { noFindings, screenshot } from './on_screen';
import { difference, pictureIn3d } from './picture_in_3d';

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testLinks(shared: () => { readonly page: Page }): void {
  test('a reload and a sent link show the same view, tools and 3D camera', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    await page.keyboard.press('Escape');
    await page.keyboard.press('2');
    await page.keyboard.press(']');
    await page.keyboard.press('r');
    await page.keyboard.press('Shift+F');
    const view = await page.locator('.picture').getAttribute('data-view');
    const first = await pictureIn3d(page);
    expect(new URL(page.url()).searchParams.get('at'), 'the camera is the view’s').toBeNull();
    const numEntries = await page.evaluate(() => history.length);
    await page.locator('.splats-canvas').focus();
    for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowLeft');
    for (let i = 0; i < 3; ++i) await page.keyboard.press('-');
    await expect.poll(() => new URL(page.url()).searchParams.get('at')).not.toBeNull();
    const turned = await pictureIn3d(page);
    expect(difference(turned, first)).toBeGreaterThan(4);
    expect(await page.evaluate(() => history.length), 'no entries').toBe(numEntries);

    const sent = page.url();
    const link = new URL(sent).searchParams;
    expect([link.get('view'), link.get('tool'), link.get('drag')]).toEqual([view, 'box', 'lasso']);
    await page.reload();
    expect(difference(await pictureIn3d(page), turned)).toBeLessThan(1);
    const other = await page.context().newPage();
    await other.goto(sent);
    expect(difference(await pictureIn3d(other), turned)).toBeLessThan(1);
    await expect(other.locator('.picture')).toHaveAttribute('data-view', view ?? '');
    for (const name of ['Box', 'Pick by lasso']) {
      const button = other.getByRole('button', { name, exact: true });
      await expect(button).toHaveAttribute('aria-pressed', 'true');
    }
    await other.close();

    // Back at the view's camera the address has none.
    await page.keyboard.press('b');
    await expect.poll(() => new URL(page.url()).searchParams.get('at')).toBeNull();
    expect(difference(await pictureIn3d(page), first)).toBeLessThan(1);
    await page.keyboard.press('Escape');
    await page.keyboard.press('i');
    await expect.poll(() => new URL(page.url()).searchParams.get('tool')).toBeNull();
  });

  test('the photographs’ cameras show their photographs, and a click goes there', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const before = await page.locator('.picture').getAttribute('data-view');
    await page.keyboard.press('h');
    const without = await pictureIn3d(page);
    await page.keyboard.press('m');
    await expect(page.getByRole('button', { name: 'Cameras' })).toHaveAttribute('aria-pressed', 'true');
    expect(difference(await pictureIn3d(page), without)).toBeGreaterThan(0.2);
    const canvas = page.locator('.splats-canvas');
    for (let i = 0; i < 5; ++i) await canvas.press('-');
    await page.waitForTimeout(500);
    // The cursor says where a camera is.
    const spots = await canvas.evaluate((element) => {
      const { left, top, width, height } = element.getBoundingClientRect();
      const found: { x: number; y: number }[] = [];
      for (let y = top + 12; y < top + height; y += 12) {
        for (let x = left + 12; x < left + width; x += 12) {
          element.dispatchEvent(new PointerEvent('pointermove', { clientX: x, clientY: y }));
          if (element.classList.contains('on-camera')) found.push({ x, y });
        }
      }
      return found;
    });
    expect(spots.length).toBeGreaterThan(0);
    const note = page.locator('.camera-note');
    let name = before;
    for (const spot of spots) {
      await page.mouse.move(spot.x, spot.y);
      if ((await note.count()) > 0) name = await note.innerText();
      if (name !== before) break;
    }
    expect(name).toMatch(/^frame-\d+\.jpg$/);
    expect(name).not.toBe(before);
    await expect(note.locator('img')).toHaveJSProperty('complete', true);
    await screenshot(page, 'scene-cameras');
    await noFindings(page);
    await page.mouse.down();
    await page.mouse.up();
    await expect(page.locator('.picture')).toHaveAttribute('data-view', name ?? '');
    await expect(page.locator('.mark'), 'this click segments nothing').toHaveCount(0);
    await page.keyboard.press('m');
    await expect(note).toHaveCount(0);
    expect(new URL(page.url()).searchParams.get('cameras')).toBeNull();
    await page.locator('.thumb').first().click();
  });
}
