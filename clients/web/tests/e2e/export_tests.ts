// Downloads of a scene with two labels: the bar, the cancel button, and what is in the files.
import { readFileSync, rmSync } from 'node:fs';
import { gunzipSync } from 'node:zlib';
import type { BrowserContext, Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { strFromU8, unzipSync } from 'fflate';
import { screenshot } from './on_screen';
import { numGaussians, readCoco, saved, shelfWith } from './saved_files';
import type { Stack } from './stack';

export interface LabelledScene {
  readonly stack: Stack;
  readonly context: BrowserContext;
  readonly page: Page;
  /** Pixels of each label's mask in the view in which it was named. */
  readonly namedAreas: ReadonlyMap<string, number>;
}

/** Adds the tests. `shared` returns the scene that the tests before have made. */
export function testExports(shared: () => LabelledScene): void {
  test('an export shows how far it is, and can be cancelled', async () => {
    const { page } = shared();
    let numDownloads = 0;
    const count = () => (numDownloads += 1);
    page.on('download', count);
    await page.getByRole('button', { name: 'Masks (PNG)' }).click();
    const bar = page.getByRole('progressbar', { name: 'Segmenting' });
    await expect(bar).toBeVisible();
    await expect.poll(() => bar.getAttribute('value')).not.toBe('0');
    await expect(page.getByText(/Segmenting: \d+ of 30 masks/)).toBeVisible();
    await screenshot(page, 'scene-export');
    await page.getByRole('button', { name: 'Cancel' }).click();
    await expect(bar).toHaveCount(0);
    await expect(page.getByRole('button', { name: 'Masks (PNG)' })).toBeEnabled();
    await page.waitForTimeout(1000);
    page.off('download', count);
    expect(numDownloads).toBe(0);
  });

  test('the download of the scene shows how far it is, and can be cancelled', async () => {
    const { page, context } = shared();
    let numDownloads = 0;
    const count = () => (numDownloads += 1);
    page.on('download', count);
    const network = await context.newCDPSession(page);
    const slow = { offline: false, latency: 0, downloadThroughput: 300_000, uploadThroughput: -1 };
    await network.send('Network.enable');
    await network.send('Network.setCacheDisabled', { cacheDisabled: true });
    await network.send('Network.emulateNetworkConditions', slow);
    await page.getByRole('button', { name: 'Scene (PLY)' }).click();
    const bar = page.getByRole('progressbar', { name: 'Downloading' });
    await expect.poll(async () => Number(await bar.getAttribute('value'))).toBeGreaterThan(0);
    await expect(page.getByText(/Downloading: [\d.]+ [kM]B of [\d.]+ MB/)).toBeVisible();
    await expect(page.getByRole('button', { name: 'COCO (JSON)' })).toBeDisabled();
    await screenshot(page, 'scene-download');
    await page.getByRole('button', { name: 'Cancel' }).click();
    await expect(bar).toHaveCount(0);
    await expect(page.getByRole('button', { name: 'Scene (PLY)' })).toBeEnabled();
    await network.send('Network.emulateNetworkConditions', { ...slow, downloadThroughput: -1 });
    await network.detach();
    await page.waitForTimeout(1000);
    page.off('download', count);
    expect(numDownloads).toBe(0);
  });

  test('downloads: the PLY is loaded again, COCO lists the labels', async () => {
    const { page, stack, namedAreas } = shared();
    test.setTimeout(400_000);
    const ply = await saved(page, page.getByRole('button', { name: 'Scene (PLY)' }));
    const count = numGaussians(ply);
    expect(count).toBeGreaterThan(1000);
    const glb = await saved(page, page.getByRole('button', { name: 'Scene (glTF)' }));
    expect(readFileSync(glb).subarray(0, 4).toString('latin1')).toBe('glTF');
    const spz = await saved(page, page.getByRole('button', { name: 'Scene (SPZ)' }));
    expect(gunzipSync(readFileSync(spz)).subarray(0, 4).toString('latin1')).toBe('NGSP');

    const json = readCoco(await saved(page, page.getByRole('button', { name: 'COCO (JSON)' })));
    expect(json.images).toHaveLength(15);
    expect(json.categories.map(({ name }) => name)).toEqual([...namedAreas.keys()]);
    expect(json.annotations.length).toBeGreaterThan(20);
    // In the view in which they were named the accepted masks were written.
    const own = json.annotations.filter(({ image_id }) => image_id === 1);
    expect(own.map(({ area }) => area)).toEqual([...namedAreas.values()]);

    const masks = await saved(page, page.getByRole('button', { name: 'Masks (PNG)' }));
    const files = unzipSync(readFileSync(masks));
    expect(JSON.parse(strFromU8(files['labels.json'] as Uint8Array))).toEqual({
      'Bunny-book': 'Bunny book',
      'Tissue-box': 'Tissue box',
    });
    expect(Object.keys(files)).toContain('Bunny-book/frame-000000.png');

    // The saved PLY becomes the Gaussians of another scene, which then needs no reconstruction.
    const folder = shelfWith(ply);
    await page.goto(`${stack.url}/new`);
    await page.setInputFiles('#folder', folder);
    await page.getByLabel('Name').fill('Again');
    await page.getByText('Steps and size').click();
    await page.getByLabel('Steps of features').fill('30');
    await page.getByLabel('Shrink photographs to').fill('0.5');
    await page.getByRole('button', { name: 'Upload and train' }).click();
    await expect(page.getByText('The scene is ready.')).toBeVisible({ timeout: 300_000 });
    await expect(page.locator('.stages .skipped', { hasText: 'Reconstruct' })).toBeVisible();
    await page.getByRole('link', { name: 'Back' }).click();
    const card = page.locator('.scene-card', { hasText: 'Again' });
    await expect(card.getByText(`${count.toLocaleString('en')} Gaussians`)).toBeVisible();
    rmSync(folder, { recursive: true });
  });
}
