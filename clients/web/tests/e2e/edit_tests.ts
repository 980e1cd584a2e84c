// Edits of a scene: each makes a version, which is undone, done again and deleted. Picks that are stored.
import { rmSync } from 'node:fs';
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import type { Spot } from './hands_in_3d';
import { colorIn3d, dragIn3d, exportedPart } from './hands_in_3d';
import {
  clickView,
  noFindings,
  numAnswers,
  picturesOf,
  placeIn3d,
  screenshot,
  settled,
} from './on_screen';
import { difference, pictureIn3d } from './picture_in_3d';
import { numGaussians, saved } from './saved_files';

/** A position on the bunny book, in shares of the first photograph. */
const book: Spot = [0.34, 0.62];
/** A position on the blue of its cover. */
const blue: Spot = [0.35, 0.4];
/** A box in the 3D view around the middle. */
const aroundMiddle: Spot[] = [
  [0.4, 0.4],
  [0.6, 0.6],
];

/** Returns the position in the 3D view, which has the photograph's camera, of a position in the photograph. */
async function spotOf(page: Page, spot: Spot): Promise<Spot> {
  const { x, y } = await placeIn3d(page, spot);
  const pane = await page.locator('.splats').boundingBox();
  if (!pane) throw new Error('no 3D view');
  return [(x - pane.x) / pane.width, (y - pane.y) / pane.height];
}

/** Returns the colour at a position once it stays the same: a busy machine draws late. */
async function restingColor(page: Page, spot: Spot): ReturnType<typeof colorIn3d> {
  let color = await colorIn3d(page, spot);
  const isSame = async () => {
    const last = JSON.stringify(color);
    color = await colorIn3d(page, spot);
    return JSON.stringify(color) === last;
  };
  await expect.poll(isSame, { timeout: 60_000 }).toBe(true);
  return color;
}

/** Returns a position on the screen where a handle is, as the cursor says; near the middle of the 3D view. */
async function handleOn(page: Page): Promise<{ x: number; y: number }> {
  const at = await page.locator('.splats-canvas').evaluate((element) => {
    const { left, top, width, height } = element.getBoundingClientRect();
    for (let y = top + 0.35 * height; y < top + 0.65 * height; y += 8) {
      for (let x = left + 0.35 * width; x < left + 0.65 * width; x += 8) {
        const event = { clientX: x, clientY: y, pointerType: 'mouse' };
        element.dispatchEvent(new PointerEvent('pointermove', event));
        if (element.classList.contains('on-handle')) return { x, y };
      }
    }
    return undefined;
  });
  if (!at) throw new Error('no handle on the screen');
  return at;
}

/** Adds the tests. `shared` returns the page, with a scene on it that has one version. */
export function testEdits(shared: () => { readonly page: Page }): void {
  const bench = () => shared().page.locator('.workbench');
  const modelNow = async () => (await bench().getAttribute('data-model')) ?? '';
  const button = (name: string) => shared().page.getByRole('button', { name, exact: true });
  const versions = () => shared().page.getByRole('region', { name: 'Versions' }).getByRole('listitem');
  const numPicked = async () =>
    Number(await shared().page.locator('.splats').getAttribute('data-picked'));
  /** Waits until a version other than `before` is shown, and returns its name. */
  const shownAfter = async (before: string) => {
    await expect(bench()).not.toHaveAttribute('data-model', before, { timeout: 240_000 });
    await expect(shared().page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
    return modelNow();
  };
  const shows = async (model: string) => {
    await expect(bench()).toHaveAttribute('data-model', model, { timeout: 60_000 });
    await expect(shared().page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
  };
  /** Picks what is in a box around the middle of the 3D view; returns the number of Gaussians. */
  const pickMiddle = async () => {
    const { page } = shared();
    await expect(page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
    await page.keyboard.press('Escape');
    await button('Pick by box').click();
    await dragIn3d(page, aroundMiddle);
    await expect.poll(numPicked, { timeout: 60_000 }).toBeGreaterThan(100);
    await page.keyboard.press('Escape');
    return numPicked();
  };
  /** The first version, and the one without the book. */
  let first = '';
  let without = '';

  test('a thing is removed and its hole filled; masks, 3D and pictures show that', async () => {
    test.setTimeout(400_000);
    const { page } = shared();
    first = await modelNow();
    await page.keyboard.press('Escape');
    await page.keyboard.press('2');
    await page.keyboard.press('b');
    const picture = page.locator('.picture');
    const whole = await pictureIn3d(page);
    const cover = await colorIn3d(page, await spotOf(page, blue));
    expect(cover.b).toBeGreaterThan(1.2 * cover.r);
    const before = await numAnswers(page);
    await clickView(page, book);
    await settled(page, before);
    const area = Number(await picture.getAttribute('data-area'));
    await expect(page.getByLabel('Fill the hole')).toBeChecked();
    const looking = page.getByText(/^Looking behind the thing: \d+ of \d+$/);
    await button('Remove').click();
    await expect(looking).toBeVisible({ timeout: 120_000 });
    await button('Cancel').click();
    await expect(looking).toHaveCount(0);
    await button('Remove').click();
    await expect(looking).toBeVisible({ timeout: 120_000 });
    await screenshot(page, 'scene-edit-running');
    without = await shownAfter(first);
    await expect(page.getByText(/^Photographs do not show this edit/)).toBeVisible();
    await expect(picture.locator('img')).toHaveAttribute('src', /^\/api\/picture.*models/);
    await expect(picture).toHaveAttribute('data-area', '0');
    // The book is blue, the shelf behind it brown.
    const behind = await colorIn3d(page, await spotOf(page, blue));
    console.log(`colour of the book: ${JSON.stringify(cover)}, behind it: ${JSON.stringify(behind)}`);
    expect(behind.b).toBeLessThan(behind.r);
    const edited = await pictureIn3d(page);
    // What is there now is another thing.
    const answers = await numAnswers(page);
    await clickView(page, book);
    await settled(page, answers);
    expect(Number(await picture.getAttribute('data-area'))).not.toBe(area);
    await page.keyboard.press('Escape');
    await page.keyboard.press('v');
    await expect(picture.locator('img')).toHaveAttribute('src', /^\/api\/photo/);
    await page.keyboard.press('v');

    // The edit that was cancelled has made none.
    await expect(versions()).toHaveCount(2);
    await expect(versions().first()).toContainText(/^Removed \d+ Gaussians and filled the hole/);
    await page.getByRole('heading', { name: 'Versions' }).scrollIntoViewIfNeeded();
    await picturesOf(page, 'scene-edited');
    await noFindings(page);

    await page.keyboard.press('Control+z'); // the click
    await page.keyboard.press('Control+z'); // Esc, before which it was made
    await expect(page.getByRole('button', { name: 'Undo' })).toHaveAttribute('title', /^Undo: Remove/);
    await page.keyboard.press('Control+z');
    await shows(first);
    await expect(picture.locator('img')).toHaveAttribute('src', /^\/api\/photo/);
    await expect(picture, 'the click is there again').toHaveAttribute('data-area', `${area}`);
    expect(difference(whole, await pictureIn3d(page))).toBeLessThan(0.2);
    await page.keyboard.press('Control+Shift+Z');
    await shows(without);
    expect(difference(edited, await pictureIn3d(page))).toBeLessThan(0.2);
    await page.keyboard.press('Control+z');
    await shows(first);
  });

  test('picks are stored under a name, picked again after a reload, hidden and exported', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const count = await pickMiddle();
    await page.getByLabel('Name of what is picked').fill('Lower part');
    await button('Store').click();
    const stored = page.getByRole('list', { name: 'Picks with names' }).getByRole('listitem');
    await expect(stored).toHaveText(new RegExp(`^Lower part${count.toLocaleString('en')}Gaussians`));
    await exportedPart(page, 'Picked');
    const file = await saved(page, page.getByRole('button', { name: 'Picked (PLY)' }));
    expect(numGaussians(file)).toBe(count);
    rmSync(file);

    await page.reload();
    await expect(page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
    expect(await numPicked()).toBe(0);
    await button('Lower part').click();
    await expect.poll(numPicked, { timeout: 60_000 }).toBe(count);
    await button('Show Lower part in 3D').click();
    await expect(page.locator('.splats')).toHaveAttribute('data-hidden', `${count}`);
    await page.getByRole('heading', { name: 'Things' }).scrollIntoViewIfNeeded();
    await picturesOf(page, 'scene-stored-picks');
    await noFindings(page);
    await button('Show Lower part in 3D').click();
    await expect(page.locator('.splats')).toHaveAttribute('data-hidden', '0');

    await button('Delete the picks Lower part').click();
    await button('Delete?').click();
    await expect(stored).toHaveCount(0);
    await page.getByRole('button', { name: 'Undo' }).click();
    await expect(stored).toHaveCount(1);
    await page.getByRole('button', { name: 'Redo' }).click();
    await expect(stored).toHaveCount(0);
  });

  test('picks are moved by a handle and by numbers; nothing is sent before that is applied', async () => {
    test.setTimeout(400_000);
    const { page } = shared();
    let numEdits = 0;
    page.on('request', (request) => (numEdits += request.url().endsWith('/EditModel') ? 1 : 0));
    const start = await modelNow();
    const count = await pickMiddle();
    const before = await restingColor(page, [0.5, 0.5]);
    await button('Move').click();
    const along = (axis: string) =>
      page.getByRole('group', { name: 'Move by, scene units' }).getByLabel(axis);
    const modes = page.getByRole('group', { name: 'What the handles in 3D do' });
    await expect(modes.getByRole('button', { name: 'Move' })).toBeFocused();
    await expect(button('Apply')).toBeDisabled();
    await page.waitForTimeout(1500); // for Spark to sort
    const at = await handleOn(page);
    await page.mouse.move(at.x, at.y);
    await page.mouse.down();
    await page.mouse.move(at.x + 40, at.y - 30, { steps: 6 });
    await page.mouse.up();
    const values = await Promise.all(['X', 'Y', 'Z'].map((axis) => along(axis).inputValue()));
    expect(values.filter((value) => Number(value) !== 0)).not.toHaveLength(0);
    await expect(page.locator('.mark'), 'a drag is no click').toHaveCount(0);
    await picturesOf(page, 'scene-move');
    await noFindings(page);
    for (const [key, name] of [
      ['r', 'Rotate'],
      ['s', 'Scale'],
      ['g', 'Move'],
    ] as const) {
      await page.locator('.splats-canvas').press(key);
      await expect(modes.getByRole('button', { name })).toHaveAttribute('aria-pressed', 'true');
    }
    await page.keyboard.press('Escape');
    await expect(button('Apply')).toHaveCount(0);
    const after = await restingColor(page, [0.5, 0.5]);
    expect(Math.abs(after.r - before.r) + Math.abs(after.g - before.g)).toBeLessThan(10);
    expect(numEdits).toBe(0);

    await button('Move').click();
    await along('X').fill('0.2');
    await along('X').press('Tab');
    await page.locator('.splats-canvas').press('Enter');
    const moved = await shownAfter(start);
    expect(numEdits).toBe(1);
    await expect.poll(numPicked, { timeout: 60_000 }).toBe(count);
    await expect(versions().first()).toContainText(`Moved ${count} Gaussians`);

    await button('Duplicate').click();
    await along('Y').fill('0.1');
    await along('Y').press('Enter');
    const copied = await shownAfter(moved);
    await expect(versions().first()).toContainText(`Copied ${count} Gaussians`);
    await expect.poll(numPicked, { timeout: 60_000 }).toBe(count);
    await page.keyboard.press('Control+z');
    await shows(moved);
    await page.keyboard.press('Control+z');
    await shows(start);
    expect(await numPicked()).toBe(count);
    expect(copied).not.toBe(moved);
  });

  test('a new colour is seen before it is applied, and is what the new version has', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const start = await modelNow();
    await expect.poll(numPicked, { timeout: 60_000 }).toBeGreaterThan(100);
    await button('Recolour').click();
    await page.getByLabel('Colour', { exact: true }).fill('#ff0000');
    const seen = await colorIn3d(page, [0.5, 0.5]);
    expect(seen.r).toBeGreaterThan(2 * Math.max(seen.g, seen.b));
    await screenshot(page, 'scene-recolor');
    await noFindings(page);
    await button('Apply').click();
    await shownAfter(start);
    const made = await colorIn3d(page, [0.5, 0.5]);
    console.log(`new colour: ${JSON.stringify(seen)} before, ${JSON.stringify(made)} after`);
    for (const part of ['r', 'g', 'b'] as const) expect(Math.abs(made[part] - seen[part])).toBeLessThan(12);
  });

  test('all but a thing is removed; versions are chosen and deleted', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const recolored = await modelNow();
    const before = await numAnswers(page);
    await clickView(page, [0.65, 0.68]);
    await settled(page, before);
    await button('Keep only this').click();
    await shownAfter(recolored);
    const corner = await colorIn3d(page, [0.2, 0.2]);
    expect(corner.r + corner.g + corner.b).toBeLessThan(60);
    await screenshot(page, 'scene-kept');

    await versions().getByRole('button', { name: /^Training/ }).click();
    await shows(first);
    await expect(page.getByText(/^Photographs do not show this edit/)).toHaveCount(0);
    for (let count = await versions().count(); count > 1; --count) {
      const remove = page.getByRole('button', { name: /^Delete the version/ }).first();
      await remove.click();
      await button('Delete?').click();
      await expect(page.getByRole('button', { name: /^Delete the version/ })).toHaveCount(count - 2);
    }
    await expect(page.getByRole('button', { name: 'Undo' })).toBeDisabled();
    await page.reload();
    await shows(first);
  });
}
