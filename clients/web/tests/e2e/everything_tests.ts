// "Everything": all segments of a view at three levels.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { clickView, noFindings, overlayIou, painted, picturesOf, shownInSplats, truthOf } from './on_screen';
import { numGaussians, saved } from './saved_files';

/** Adds the tests. `shared` returns the page, with a scene that has a bunny book. */
export function testEverything(shared: () => { readonly page: Page }): void {
  const layer = (page: Page) => page.locator('canvas.segments');
  const listed = async (page: Page) => {
    const text = await page.getByText(/^\d+ (part|object|group)s? in this view$/).innerText();
    return Number(/\d+/.exec(text)?.[0]);
  };

  test('everything is shown at three levels', async () => {
    const { page } = shared();
    await page.keyboard.press('Escape');
    await page.keyboard.press('g');
    const counts: number[] = [];
    for (const [name, level] of [
      ['Parts', '0'],
      ['Groups', '2'],
      ['Objects', '1'],
    ] as const) {
      await page.getByRole('button', { name, exact: true }).click();
      await expect(layer(page)).toHaveAttribute('data-level', level, { timeout: 60_000 });
      counts.push(await listed(page));
    }
    const [parts = 0, groups = 0, objects = 0] = counts;
    console.log(`everything: ${parts} parts, ${objects} objects, ${groups} groups in the view`);
    expect(parts).toBeGreaterThan(objects);
    expect(objects).toBeGreaterThan(groups);
    expect(groups).toBeGreaterThan(1);
    await picturesOf(page, 'scene-everything');
    await noFindings(page);
  });

  test('a click on a segment picks it, to name, export or hide it', async () => {
    test.setTimeout(300_000);
    const { page } = shared();
    const view = (await page.locator('.picture').getAttribute('data-view')) ?? '';
    const book = await truthOf(page, view, 114);
    const edges = await page.locator('.picture').boundingBox();
    if (!edges) throw new Error('no view on the screen');
    // Next to the middle, where another thing may be in front. Some pixels are in no segment.
    const around = [
      [-0.05, 0.1],
      [0, 0.05],
      [0.05, 0.1],
      [-0.05, -0.05],
    ] as const;
    let numMoves = 0;
    const nameAtNextSpot = async () => {
      const [dx, dy] = around[numMoves++ % around.length] ?? around[0];
      const [x, y] = [book.inside[0] + dx, book.inside[1] + dy];
      await page.mouse.move(edges.x + x * edges.width, edges.y + y * edges.height);
      await painted(page);
      return (await page.locator('.segment-under').allInnerTexts()).join();
    };
    // It has the name of the label whose mask it has.
    await expect.poll(nameAtNextSpot, { timeout: 60_000 }).toBe('Bunny book');
    await expect(page.locator('.picture')).toHaveAttribute('data-area', '0');
    await page.mouse.down();
    await page.mouse.up();
    await expect(page.getByLabel('Name of the segment')).toBeFocused();
    await expect(page.getByText(/Seen in \d+ views/)).toBeVisible({ timeout: 60_000 });
    const iou = await overlayIou(page, book);
    console.log(`IoU of the segment of the book: ${iou.toFixed(3)}`);
    expect(iou).toBeGreaterThan(0.7);
    await noFindings(page);

    const list = page.getByText(/objects in this view$/);
    await list.click();
    const row = page.locator('.segment-list').getByRole('button', { name: /^Bunny book / });
    await expect(row).toHaveAttribute('aria-pressed', 'true');
    const said = Number(/([\d,]+) Gaussians/.exec(await row.innerText())?.[1]?.replace(',', ''));
    const file = await saved(page, page.getByRole('button', { name: 'Export (PLY)' }));
    expect(numGaussians(file)).toBe(said);

    await page.getByRole('button', { name: 'Hide', exact: true }).click();
    await expect(page.getByText('1 hidden in 3D.')).toBeVisible({ timeout: 60_000 });
    await expect(row).toContainText('hidden');
    await shownInSplats(page, 'hidden');
    await noFindings(page);
    await page.getByRole('button', { name: 'Show them again' }).click();
    await expect(page.getByText('hidden in 3D.')).toHaveCount(0);
    await shownInSplats(page, 'all');
    await list.click();
  });

  test('the keyboard picks a segment, and ends everything', async () => {
    const { page } = shared();
    const area = async () => Number(await page.locator('.picture').getAttribute('data-area'));
    await page.locator('.picture').focus();
    const underNext = async () => {
      await page.keyboard.press('ArrowLeft');
      await painted(page);
      return layer(page).getAttribute('data-under');
    };
    // Some pixels are in no segment.
    await expect.poll(underNext).not.toBe('0');
    await page.keyboard.press('Enter');
    await expect.poll(area).toBeGreaterThan(0);
    await page.keyboard.press('Escape');
    await expect.poll(area).toBe(0);
    await page.keyboard.press('Escape');
    await expect(layer(page)).toHaveAttribute('data-level', '');
  });

  test('a name that is entered before the mask is there is given', async () => {
    const { page } = shared();
    const named = page.locator('.things li', { hasText: 'Hasty' });
    const nameAt = async (spot: readonly [number, number], how: 'click' | 'segment') => {
      await clickView(page, spot);
      if (how === 'click') await page.keyboard.press('l');
      await expect(page.getByLabel('Name of the segment')).toBeFocused();
      await page.keyboard.insertText('Hasty');
      await page.keyboard.press('Enter');
      await expect(named).toHaveCount(1);
      await expect(page.locator('.picture')).toHaveAttribute('data-area', '0');
      await page.locator('.picture').focus();
      await page.keyboard.press('Control+z');
      await expect(named).toHaveCount(0);
      await page.keyboard.press('Escape');
    };
    // A server that takes a second for all but the stream: the other views are late.
    await page.route('**/SegmentationService/SegmentViews', async (route) => {
      await new Promise((resolve) => setTimeout(resolve, 1000));
      await route.continue();
    });
    const tissueBox = [0.65, 0.68] as const;
    await nameAt(tissueBox, 'click');
    await page.keyboard.press('g');
    await expect(layer(page)).toHaveAttribute('data-level', '1', { timeout: 60_000 });
    await nameAt(tissueBox, 'segment');
    await page.unroute('**/SegmentationService/SegmentViews');
    await page.keyboard.press('Escape');
    await expect(layer(page)).toHaveAttribute('data-level', '');
  });
}
