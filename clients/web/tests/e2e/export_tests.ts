// Downloads of a scene with two labels: the bar, the cancel button, and what is in the files.
import { readFileSync, rmSync } from 'node:fs';
import { gunzipSync } from 'node:zlib';
import type { BrowserContext, Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { clickView, noFindings, numAnswers, picturesOf, screenshot, settled } from './on_screen';
import type { Coco } from './saved_files';
import { numGaussians, readCoco, saved, shelfWith, textIn, unzipped } from './saved_files';
import type { Stack } from './stack';

export interface LabelledScene {
  readonly stack: Stack;
  readonly context: BrowserContext;
  readonly page: Page;
  /** Pixels of each label's mask in the view in which it was named. */
  readonly namedAreas: ReadonlyMap<string, number>;
}

/** The annotations of each category: their number, and pixels in the first photograph. */
function perCategory({ categories, annotations }: Coco) {
  return new Map(
    categories.map(({ id, name }) => {
      const own = annotations.filter(({ category_id }) => category_id === id);
      return [name, { count: own.length, first: own.find(({ image_id }) => image_id === 1)?.area }];
    }),
  );
}

/** Adds the tests. `shared` returns the scene that the tests before have made. */
export function testExports(shared: () => LabelledScene): void {
  test('an export shows how far it is, and can be cancelled', async () => {
    const { page } = shared();
    let numDownloads = 0;
    const count = () => (numDownloads += 1);
    page.on('download', count);
    await page.getByRole('button', { name: 'Export (ZIP)' }).click();
    const bar = page.getByRole('progressbar', { name: 'Segmenting' });
    await expect(bar).toBeVisible();
    await expect.poll(() => bar.getAttribute('value')).not.toBe('0');
    await expect(page.getByText(/Segmenting: \d+ of 30 masks/)).toBeVisible();
    await screenshot(page, 'scene-export');
    await page.getByRole('button', { name: 'Cancel' }).click();
    await expect(bar).toHaveCount(0);
    await expect(page.getByRole('button', { name: 'Export (ZIP)' })).toBeEnabled();
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
    await expect(page.getByText(/Downloading: [\d.]+ [kM]B of [\d.]+ [kM]B/)).toBeVisible();
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

  test('all names in all photographs are exported for annotation tools', async () => {
    const { page, namedAreas } = shared();
    test.setTimeout(400_000);
    const format = page.getByLabel('Format');
    const save = page.getByRole('button', { name: 'Export (ZIP)' });
    const named = async (id: string) => {
      await format.selectOption(id);
      const download = page.waitForEvent('download');
      await save.click();
      const file = await download;
      expect(file.suggestedFilename()).toBe(`Kitchen-shelf-${id}.zip`);
      return unzipped(await file.path());
    };
    await page.getByLabel('With a table of the things').check();
    const coco = await named('coco');
    const json = JSON.parse(textIn(coco, 'annotations.json')) as Coco;
    expect(json.images).toHaveLength(15);
    const found = perCategory(json);
    expect([...found.keys()].sort()).toEqual([...namedAreas.keys()].sort());
    for (const [name, accepted] of namedAreas) {
      expect(found.get(name)?.count).toBeGreaterThan(7);
      // In the view in which it was named the accepted mask was written.
      expect(found.get(name)?.first).toBe(accepted);
    }
    const table = textIn(coco, 'things.csv').trim().split('\n');
    expect(table).toHaveLength(1 + namedAreas.size);
    expect(table[0]).toMatch(/^id,parent,name,category/);
    await page.getByLabel('With a table of the things').uncheck();

    for (const [id, path] of [
      ['yolo', 'data.yaml'],
      ['labelme', 'frame-000000.json'],
      ['cvat', 'annotations.xml'],
      ['masks', 'Bunny-book/frame-000000.png'],
      ['ids', 'frame-000000.png'],
    ] as const) {
      const files = await named(id);
      expect([...files.keys()], id).toContain(path);
      expect([...files.keys()], id).not.toContain('things.csv');
    }
    await noFindings(page);
  });

  test('all segments of a level are exported, too', async () => {
    const { page } = shared();
    test.setTimeout(400_000);
    await page.getByRole('combobox', { name: 'What' }).selectOption('All groups');
    await page.getByLabel('Format').selectOption('COCO');
    const zip = await saved(page, page.getByRole('button', { name: 'Export (ZIP)' }));
    const json = JSON.parse(textIn(unzipped(zip), 'annotations.json')) as Coco;
    expect(json.annotations.length).toBeGreaterThan(50);
    await picturesOf(page, 'scene-annotations');
    await page.getByRole('combobox', { name: 'What' }).selectOption({ index: 0 });
  });

  test('the segment is exported without a name', async () => {
    const { page } = shared();
    test.setTimeout(300_000);
    await page.keyboard.press('Escape');
    const coco = page.getByRole('button', { name: 'COCO (JSON)' });
    await expect(coco).toBeDisabled();
    const before = await numAnswers(page);
    await clickView(page, [0.37, 0.6]);
    await settled(page, before);
    const shown = Number(await page.locator('.picture').getAttribute('data-area'));
    const json = readCoco(await saved(page, coco));
    expect(json.categories.map(({ name }) => name)).toEqual(['segment']);
    expect(json.annotations.find(({ image_id }) => image_id === 1)?.area).toBe(shown);
    expect(json.annotations.length).toBeGreaterThan(7);
    const masks = unzipped(await saved(page, page.getByRole('button', { name: 'Masks (PNG)' })));
    expect(JSON.parse(textIn(masks, 'labels.json'))).toEqual({ segment: 'segment' });
    expect([...masks.keys()]).toContain('segment/frame-000000.png');
    await page.keyboard.press('Escape');
  });

  test('downloads: Gaussians and meshes are what they say, the PLY is loaded again', async () => {
    const { page, stack } = shared();
    test.setTimeout(400_000);
    const ply = await saved(page, page.getByRole('button', { name: 'Scene (PLY)' }));
    const count = numGaussians(ply);
    expect(count).toBeGreaterThan(1000);
    const glb = await saved(page, page.getByRole('button', { name: 'Scene (glTF)' }));
    expect(readFileSync(glb).subarray(0, 4).toString('latin1')).toBe('glTF');
    const spz = await saved(page, page.getByRole('button', { name: 'Scene (SPZ)' }));
    expect(gunzipSync(readFileSync(spz)).subarray(0, 4).toString('latin1')).toBe('NGSP');
    const sog = await saved(page, page.getByRole('button', { name: 'Scene (SOG)' }));
    expect(readFileSync(sog).subarray(0, 2).toString('latin1')).toBe('PK');
    const html = await saved(page, page.getByRole('button', { name: 'Scene (web page)' }));
    expect(readFileSync(html).subarray(0, 15).toString('latin1').toLowerCase()).toBe(
      '<!doctype html>',
    );

    const plyMesh = await saved(page, page.getByRole('button', { name: 'Scene mesh (PLY)' }));
    const head = readFileSync(plyMesh).subarray(0, 600).toString('latin1');
    const numOpen = Number(/element face (\d+)/.exec(head)?.[1]);
    expect(numOpen).toBeGreaterThan(1000);
    await page.getByLabel('Watertight').check();
    const closed = await saved(page, page.getByRole('button', { name: 'Scene mesh (GLB)' }));
    expect(readFileSync(closed).subarray(0, 4).toString('latin1')).toBe('glTF');

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
