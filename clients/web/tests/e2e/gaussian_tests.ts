// Gaussians in 3D that are picked by box and lasso, cut off by the crop box, or found as floaters.
import { rmSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import type { Spot } from './hands_in_3d';
import { colorIn3d, dragIn3d, exportedPart } from './hands_in_3d';
import { noFindings, picturesOf, screenshot } from './on_screen';
import { numGaussians, saved } from './saved_files';

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testGaussians(shared: () => { readonly page: Page }): void {
  const splats = () => shared().page.locator('.splats');
  const count = async (of: 'picked' | 'hidden') =>
    Number(await splats().getAttribute(`data-${of}`));
  const change = async (act: () => Promise<void>) => {
    const before = await count('picked');
    await act();
    await expect.poll(() => count('picked'), { timeout: 60_000 }).not.toBe(before);
    return count('picked');
  };
  const middle: Spot = [0.5, 0.5];
  const aroundMiddle: Spot[] = [
    [0.4, 0.4],
    [0.6, 0.6],
  ];

  test('a box and a lasso pick Gaussians in 3D, Shift adds and Alt takes away', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    await page.keyboard.press('Escape');
    await page.keyboard.press('2');
    await page.keyboard.press('b');
    await expect(page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
    const before = await colorIn3d(page, middle);
    await page.keyboard.press('Shift+R');
    await expect(page.getByRole('button', { name: 'Pick by box' })).toHaveAttribute('aria-pressed', 'true');
    const inBox = await change(() => dragIn3d(page, aroundMiddle));
    expect(inBox).toBeGreaterThan(100);
    // Tinted: less red, more green and blue for it.
    const tinted = await colorIn3d(page, middle);
    expect(tinted.r / before.r).toBeLessThan(0.6);
    expect(tinted.g / before.g).toBeGreaterThan(1);
    await expect(page.locator('.mark'), 'a drag is no click').toHaveCount(0);

    await page.getByRole('button', { name: 'Pick by lasso' }).click();
    const triangle: Spot[] = [
      [0.1, 0.4],
      [0.3, 0.4],
      [0.2, 0.6],
    ];
    const added = await change(() => dragIn3d(page, triangle, 'Shift'));
    expect(added).toBeGreaterThan(inBox);
    const left = await change(() => dragIn3d(page, triangle, 'Alt'));
    expect(left).toBe(inBox);
    const alone = await change(() => dragIn3d(page, triangle));
    expect(alone).toBe(added - inBox);
    await picturesOf(page, 'scene-picked');

    // What is in front is some of what is through the depth.
    await page.getByRole('button', { name: 'In front' }).click();
    const front = await change(() => dragIn3d(page, triangle));
    expect(front).toBeGreaterThan(0);
    expect(front).toBeLessThan(alone);
    await page.getByRole('button', { name: 'In front' }).click();
    await noFindings(page);
  });

  test('the keyboard picks what is in the middle', async () => {
    const { page } = shared();
    await page.locator('.splats-canvas').focus();
    const all = await change(() => page.keyboard.press('Enter'));
    expect(all).toBeGreaterThan(100);
    await page.getByRole('button', { name: 'Pick nothing' }).click();
    await expect.poll(() => count('picked')).toBe(0);
  });

  test('picked Gaussians are hidden, shown alone and saved', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    await page.getByRole('button', { name: 'Pick by box' }).click();
    const before = await colorIn3d(page, middle);
    const numPicked = await change(() => dragIn3d(page, aroundMiddle));
    await exportedPart(page, 'Picked');
    const picked = await saved(page, page.getByRole('button', { name: 'Picked (PLY)' }));
    expect(numGaussians(picked)).toBe(numPicked);
    const corner: Spot = [0.2, 0.5];
    await page.getByRole('button', { name: 'Only', exact: true }).click();
    const empty = await colorIn3d(page, corner);
    expect(empty.r + empty.g + empty.b).toBeLessThan(60);
    await page.keyboard.press('Delete');
    await expect.poll(() => count('hidden')).toBe(numPicked);
    expect(await count('picked')).toBe(0);
    const without = await colorIn3d(page, middle);
    expect(without).not.toEqual(before);
    await page.keyboard.press('Control+z');
    await expect.poll(() => count('picked')).toBe(numPicked);
    expect(await count('hidden')).toBe(0);
    await page.keyboard.press('Control+Shift+Z');
    await expect.poll(() => count('hidden')).toBe(numPicked);
    expect(await colorIn3d(page, middle)).toEqual(without);

    await exportedPart(page, 'Scene');
    const whole = await saved(page, page.getByRole('button', { name: 'Scene (PLY)' }));
    await exportedPart(page, 'Without hidden');
    const rest = await saved(page, page.getByRole('button', { name: 'Without hidden (PLY)' }));
    expect(numGaussians(rest)).toBe(numGaussians(whole) - numPicked);
    for (const file of [picked, whole, rest]) rmSync(file);
    await noFindings(page);
    await page.getByRole('button', { name: 'Show hidden' }).click();
    await expect.poll(() => count('hidden')).toBe(0);
    const after = await colorIn3d(page, middle);
    expect(Math.abs(after.r - before.r) + Math.abs(after.g - before.g)).toBeLessThan(10);
    await page.keyboard.press('Escape');
    await expect(page.getByRole('button', { name: 'Turn' })).toHaveAttribute('aria-pressed', 'true');
  });

  test('the crop box hides all outside, its faces are dragged, and its inside is saved', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const cropOf = async () =>
      ((await splats().getAttribute('data-crop')) ?? '').split(' ').map(Number);
    await page.keyboard.press('h');
    await page.keyboard.press('c');
    await expect.poll(cropOf, { timeout: 60_000 }).toHaveLength(6);
    const inside = page.getByText(/[\d,]+ inside the box/);
    const numInside = async () => Number(/[\d,]+/.exec(await inside.innerText())?.[0].replace(/,/g, ''));
    const first = await numInside();
    await exportedPart(page, 'Scene');
    const whole = await saved(page, page.getByRole('button', { name: 'Scene (PLY)' }));
    // 90 % along each of three axes.
    expect(first / numGaussians(whole)).toBeGreaterThan(0.7);
    expect(first / numGaussians(whole)).toBeLessThan(0.9);
    await page.waitForTimeout(1500); // for Spark to sort
    await picturesOf(page, 'scene-crop');

    await page.getByText('Faces of the crop box').click();
    const slider = page.getByLabel('X from');
    await slider.focus();
    await page.keyboard.press('PageUp');
    await expect.poll(numInside).toBeLessThan(first);
    await noFindings(page);

    // The nearest handles are on the screen: one of them follows a drag.
    const before = await cropOf();
    const canvas = page.locator('.splats-canvas');
    // The cursor says where a handle is.
    const at = await canvas.evaluate((element) => {
      const { left, top, width, height } = element.getBoundingClientRect();
      for (let y = top + 8; y < top + height; y += 8) {
        for (let x = left + 8; x < left + width; x += 8) {
          element.dispatchEvent(new PointerEvent('pointermove', { clientX: x, clientY: y }));
          if (element.classList.contains('on-handle')) return { x, y };
        }
      }
      return undefined;
    });
    if (!at) throw new Error('no handle on the screen');
    await page.mouse.move(at.x, at.y);
    await page.mouse.down();
    await page.mouse.move(at.x + 30, at.y + 25, { steps: 5 });
    await page.mouse.up();
    const moved = (await cropOf()).filter((value, i) => value !== before[i]);
    expect(moved, 'one face').toHaveLength(1);
    await expect(page.locator('.mark'), 'a drag is no click').toHaveCount(0);

    await exportedPart(page, 'Inside');
    const kept = await saved(page, page.getByRole('button', { name: 'Inside (PLY)' }));
    expect(numGaussians(kept)).toBe(await numInside());
    for (const file of [whole, kept]) rmSync(file);
    await page.keyboard.press('c');
    await expect(splats()).not.toHaveAttribute('data-crop', /./);
  });

  test('floaters are counted, shown, and hidden when the person says so', async () => {
    const { page } = shared();
    await page.getByRole('button', { name: 'Find floaters' }).click();
    await expect(page.getByText(/[\d,]+ floaters picked. Hide them\?/)).toBeVisible({ timeout: 60_000 });
    const numFloaters = await count('picked');
    expect(numFloaters).toBeGreaterThan(0);
    expect(await count('hidden')).toBe(0);
    await page.waitForTimeout(1500); // for Spark to sort
    await screenshot(page, 'scene-floaters');
    await page.getByRole('button', { name: 'Hide floaters' }).click();
    await expect.poll(() => count('hidden')).toBe(numFloaters);
    await page.getByRole('button', { name: 'Find floaters' }).click();
    await expect(page.getByText('No floaters found.')).toBeVisible({ timeout: 60_000 });
    await page.getByRole('button', { name: 'Show hidden' }).click();
    await page.keyboard.press('b');
  });
}
