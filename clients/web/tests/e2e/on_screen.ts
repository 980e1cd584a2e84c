// Reads what a scene's screen shows, and compares it with the truth.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import AxeBuilder from '@axe-core/playwright';
import type { Page } from '@playwright/test';
import { expect } from '@playwright/test';
import { artefacts, shelf } from './stack';

export function screenshot(page: Page, name: string): Promise<Buffer> {
  return page.screenshot({ path: join(artefacts, `${name}.png`), animations: 'disabled' });
}

/** Checks that axe-core finds nothing at all. */
export async function noFindings(page: Page): Promise<void> {
  const { violations } = await new AxeBuilder({ page }).analyze();
  expect(violations.map(({ id, nodes }) => `${id}: ${nodes[0]?.html.slice(0, 120)}`)).toEqual([]);
}

async function noSeriousFindings(page: Page): Promise<void> {
  const { violations } = await new AxeBuilder({ page }).analyze();
  const serious = violations.filter(({ impact }) => impact === 'serious' || impact === 'critical');
  const places = (nodes: { html: string }[]) =>
    nodes.map(({ html }) => html.slice(0, 120)).join(' | ');
  expect(serious.map(({ id, nodes }) => `${id}: ${places(nodes)}`)).toEqual([]);
}

/** Takes pictures on a wide screen, light and dark, and a narrow one. axe-core must find nothing serious. */
export async function picturesOf(page: Page, name: string): Promise<void> {
  await screenshot(page, `${name}-1440`);
  await noSeriousFindings(page);
  await page.emulateMedia({ colorScheme: 'dark' });
  await screenshot(page, `${name}-1440-dark`);
  await noSeriousFindings(page);
  await page.emulateMedia({ colorScheme: 'light' });
  await page.setViewportSize({ width: 390, height: 844 });
  await page.waitForTimeout(300); // for the 3D view to follow
  await screenshot(page, `${name}-390`);
  await noSeriousFindings(page);
  await page.setViewportSize({ width: 1440, height: 900 });
}

export interface Truth {
  /** A pixel well inside the thing, as shares of width and height. */
  readonly inside: readonly [number, number];
  /** Data URL of the label image. */
  readonly labels: string;
  readonly value: number;
}

/** Returns the truth of a thing in a view of the shelf. `value`: its grey in the label image. */
export async function truthOf(page: Page, view: string, value: number): Promise<Truth> {
  const file = join(shelf, 'labels', view.replace('.jpg', '.png'));
  const labels = `data:image/png;base64,${readFileSync(file).toString('base64')}`;
  const inside = await page.evaluate(
    async ([url, grey]) => {
      const image = new Image();
      image.src = url;
      await image.decode();
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext('2d') as OffscreenCanvasRenderingContext2D;
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      const spots: [number, number][] = [];
      for (let i = 0; i < data.length / 4; ++i) {
        if (data[4 * i] === grey) spots.push([i % image.width, Math.floor(i / image.width)]);
      }
      const mean = [0, 1].map(
        (axis) => spots.reduce((sum, spot) => sum + spot[axis as 0 | 1], 0) / spots.length,
      );
      const [cx = 0, cy = 0] = mean;
      const far = ([x, y]: [number, number]) => (x - cx) ** 2 + (y - cy) ** 2;
      const nearest = spots.reduce((best, spot) => (far(spot) < far(best) ? spot : best));
      return [(nearest[0] + 0.5) / image.width, (nearest[1] + 0.5) / image.height] as const;
    },
    [labels, value] as const,
  );
  return { inside, labels, value };
}

/** Returns the IoU of the drawn mask with the truth, pixel by pixel. */
export function overlayIou(page: Page, { labels, value }: Truth): Promise<number> {
  return page.evaluate(
    async ([url, grey]) => {
      const overlay = document.querySelector('.picture canvas.mask') as HTMLCanvasElement;
      const { width, height } = overlay;
      const drawn = overlay.getContext('2d')?.getImageData(0, 0, width, height).data;
      const image = new Image();
      image.src = url;
      await image.decode();
      const canvas = new OffscreenCanvas(width, height);
      const context = canvas.getContext('2d') as OffscreenCanvasRenderingContext2D;
      context.imageSmoothingEnabled = false;
      context.drawImage(image, 0, 0, width, height);
      const truth = context.getImageData(0, 0, width, height).data;
      let both = 0;
      let either = 0;
      for (let i = 0; drawn && i < width * height; ++i) {
        const a = (drawn[4 * i + 3] as number) > 0;
        const b = truth[4 * i] === grey;
        both += a && b ? 1 : 0;
        either += a || b ? 1 : 0;
      }
      return either === 0 ? 0 : both / either;
    },
    [labels, value] as const,
  );
}

/** Waits until the view and the strip show photographs from the server. */
export async function photographsShown(page: Page, width: number): Promise<void> {
  const shown = page.locator('.picture img[src*="/api/photo"]');
  await expect
    .poll(() => shown.evaluate((image: HTMLImageElement) => image.naturalWidth), { timeout: 30_000 })
    .toBe(width);
  const thumb = page.locator('.thumb img').first();
  await expect(thumb).toHaveAttribute('src', /api\/photo.*max_side=/);
  await expect
    .poll(() => thumb.evaluate((image: HTMLImageElement) => image.naturalWidth), { timeout: 60_000 })
    .toBe(256);
}

/** Clicks at shares of the view's width and height. */
export async function clickView(
  page: Page,
  [x, y]: readonly [number, number],
  shift = false,
): Promise<void> {
  const edges = await page.locator('.picture').boundingBox();
  if (!edges) throw new Error('no view on the screen');
  if (shift) await page.keyboard.down('Shift');
  await page.mouse.click(edges.x + x * edges.width, edges.y + y * edges.height);
  if (shift) await page.keyboard.up('Shift');
}

/**
 * Returns the position in the 3D view of what the photograph shows at shares of its width and height. The
 * 3D view has the first view's camera, and shows all of the photograph as large as fits.
 */
export async function placeIn3d(
  page: Page,
  [x, y]: readonly [number, number],
): Promise<{ x: number; y: number }> {
  const picture = await page.locator('.picture').boundingBox();
  const pane = await page.locator('.splats').boundingBox();
  if (!picture || !pane) throw new Error('no view and 3D view on the screen');
  const ratio = picture.width / picture.height;
  const width = Math.min(pane.width, pane.height * ratio);
  return {
    x: pane.x + pane.width / 2 + (x - 0.5) * width,
    y: pane.y + pane.height / 2 + ((y - 0.5) * width) / ratio,
  };
}

/** Draws a box from one corner to the other, in shares of the view's width and height. */
export async function dragBox(
  page: Page,
  from: readonly [number, number],
  to: readonly [number, number],
): Promise<void> {
  const edges = await page.locator('.picture').boundingBox();
  if (!edges) throw new Error('no view on the screen');
  const at = ([x, y]: readonly [number, number]) =>
    [edges.x + x * edges.width, edges.y + y * edges.height] as const;
  await page.mouse.move(...at(from));
  await page.mouse.down();
  await page.mouse.move(...at([(from[0] + to[0]) / 2, (from[1] + to[1]) / 2]));
  await page.mouse.move(...at(to));
  await page.mouse.up();
}

/** Draws a stroke through these positions, in shares of the view's width and height. */
export async function drawStroke(
  page: Page,
  path: readonly (readonly [number, number])[],
  shift = false,
): Promise<void> {
  const edges = await page.locator('.picture').boundingBox();
  if (!edges) throw new Error('no view on the screen');
  if (shift) await page.keyboard.down('Shift');
  for (const [i, [x, y]] of path.entries()) {
    const at = [edges.x + x * edges.width, edges.y + y * edges.height] as const;
    await page.mouse.move(...at, { steps: i === 0 ? 1 : 10 });
    if (i === 0) await page.mouse.down();
  }
  await page.mouse.up();
  if (shift) await page.keyboard.up('Shift');
}

/** Returns the number of answers drawn since the page was opened. */
export async function numAnswers(page: Page): Promise<number> {
  return Number(await page.locator('.picture').getAttribute('data-answers'));
}

/** Waits for more than `before` answers of the stream and for the other views. */
export async function settled(page: Page, before: number): Promise<void> {
  await page.waitForFunction(
    (count) => Number(document.querySelector<HTMLElement>('.picture')?.dataset.answers) > count,
    before,
    { timeout: 60_000 },
  );
}

/** Waits until the 3D view shows the selection in this way, and Spark has sorted. */
export async function shownInSplats(page: Page, how: string): Promise<void> {
  const there = page.locator(`.splats[data-status=ready][data-shown=${how}]`);
  await expect(there).toBeVisible({ timeout: 60_000 });
  await page.waitForTimeout(2500);
}

/** Waits for the sizes that the prompt may mean, and returns their number. */
export async function numSizes(page: Page): Promise<number> {
  const said = page.locator('output[for=size]');
  await expect(said).toHaveText(/best guess|smaller|larger|the only size/, { timeout: 60_000 });
  const count = /of (\d+)/.exec(await said.innerText())?.[1] ?? '1';
  if (count !== '1') await expect(page.getByLabel('Size', { exact: true })).toBeEnabled();
  return Number(count);
}

/** Waits until the page has painted what it changed. */
export function painted(page: Page): Promise<void> {
  return page.evaluate(
    () =>
      new Promise<void>((done) => {
        requestAnimationFrame(() => setTimeout(() => requestAnimationFrame(() => done()), 50));
      }),
  );
}

/** Moves the size slider to a size, the smallest of which is 0, and waits until it is shown. */
export async function chooseSize(page: Page, index: number): Promise<void> {
  await page.getByLabel('Size', { exact: true }).fill(String(index));
  await expect(page.locator('output[for=size]')).toHaveText(new RegExp(`^${index + 1} of`));
  // The masks are painted after the frame that has the text.
  await painted(page);
}

/** Measures the answers a second while the scale is dragged back and forth for four seconds. */
export async function answersPerSecond(page: Page): Promise<number> {
  await page.getByText('More', { exact: true }).click();
  const edges = await page.getByLabel('Scale').boundingBox();
  if (!edges) throw new Error('no slider');
  const y = edges.y + edges.height / 2;
  await page.mouse.move(edges.x + 10, y);
  await page.mouse.down();
  const before = await numAnswers(page);
  const begin = Date.now();
  for (let i = 0; Date.now() - begin < 4000; ++i) {
    await page.mouse.move(edges.x + (0.5 - 0.48 * Math.cos(i / 20)) * edges.width, y);
    await page.waitForTimeout(8);
  }
  const rate = (1000 * ((await numAnswers(page)) - before)) / (Date.now() - begin);
  await page.mouse.up();
  await page.getByText('More', { exact: true }).click();
  return rate;
}
