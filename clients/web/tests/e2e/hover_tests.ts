// The preview of a click under the pointer.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { noFindings, numAnswers, numSizes, screenshot, settled } from './on_screen';

type Shares = readonly [number, number];

/** Moves the pointer to shares of the photograph's width and height, a pixel's middle. */
async function point(page: Page, [x, y]: Shares): Promise<void> {
  const edges = await page.locator('.picture').boundingBox();
  if (!edges) throw new Error('no view on the screen');
  await page.mouse.move(edges.x + x * edges.width, edges.y + y * edges.height);
}

/** Returns the mask's pixels of the canvas, as text that can be compared. */
function drawn(page: Page, selector: string): Promise<string> {
  return page.locator(selector).evaluate((element) => {
    const canvas = element as HTMLCanvasElement;
    const { width, height } = canvas;
    const { data } = canvas.getContext('2d')?.getImageData(0, 0, width, height) ?? { data: [] };
    let text = `${width}x${height} `;
    let run = 0;
    for (let i = 3, last = 0; i < data.length; i += 4) {
      const now = (data[i] as number) > 0 ? 1 : 0;
      if (now === last) ++run;
      else text += `${run},`;
      if (now !== last) run = 1;
      last = now;
    }
    return text;
  });
}

/**
 * Returns the milliseconds from each move of the pointer to the frame after its outline is painted. Each
 * move begins when the outline before it is there.
 */
async function latencies(page: Page, count: number): Promise<number[]> {
  await page.evaluate(() => {
    const times: number[] = [];
    let moved = 0;
    const canvas = document.querySelector('canvas.click-preview') as HTMLCanvasElement;
    document.addEventListener('pointermove', () => (moved = performance.now()), true);
    new MutationObserver(() => {
      if (canvas.dataset.at === '') return;
      const from = moved;
      requestAnimationFrame(() => setTimeout(() => times.push(performance.now() - from)));
    }).observe(canvas, { attributes: true, attributeFilter: ['data-at'] });
    Object.assign(window, { hoverTimes: times });
  });
  const done = () =>
    page.evaluate(() => (window as unknown as { hoverTimes: number[] }).hoverTimes.length);
  for (let i = 0; i < count; ++i) {
    await point(page, [0.2 + 0.6 * ((i * 0.618) % 1), 0.3 + 0.5 * ((i * 0.382) % 1)]);
    await expect.poll(done, { intervals: [10], timeout: 10_000 }).toBe(i + 1);
  }
  return page.evaluate(() => (window as unknown as { hoverTimes: number[] }).hoverTimes);
}

/** Adds the tests. `shared` returns the page, with a scene on it. */
export function testHover(shared: () => { readonly page: Page }): void {
  const book: Shares = [0.37, 0.6];
  const box: Shares = [0.65, 0.68];

  test('the pointer shows what a click would give, and the click gives it', async () => {
    const { page } = shared();
    const preview = page.locator('canvas.click-preview');
    const area = async () => Number(await page.locator('.picture').getAttribute('data-area'));
    await page.keyboard.press('Escape');
    await page.keyboard.press('1');
    await point(page, book);
    await expect(preview).not.toHaveAttribute('data-area', '0');
    expect(await area(), 'nothing is segmented').toBe(0);
    await screenshot(page, 'scene-hover');
    const over = await page.locator('.picture').boundingBox();
    expect(await preview.boundingBox(), 'it is over the photograph').toEqual(over);
    const shown = Number(await preview.getAttribute('data-area'));
    const outlined = await drawn(page, 'canvas.click-preview');
    const before = await numAnswers(page);
    let numAsked = 0;
    page.on('websocket', () => (numAsked += 1));
    await page.mouse.down();
    await page.mouse.up();
    await settled(page, before);
    expect(await area()).toBe(shown);
    expect(await drawn(page, '.picture canvas.mask')).toBe(outlined);
    await expect(preview).toHaveAttribute('data-area', '0');
    expect(numAsked, 'the stream is the one that was there').toBe(0);

    // With a click in the prompt it is the next one's.
    await numSizes(page);
    await point(page, box);
    await expect(preview).not.toHaveAttribute('data-area', '0');
    expect(Number(await preview.getAttribute('data-area'))).toBeGreaterThan(shown);
    await expect(page.locator('.mark')).toHaveCount(1);
    await screenshot(page, 'scene-hover-next');
    await noFindings(page);
  });

  test('the preview goes with the pointer, the view, the prompt and its switch', async () => {
    const { page } = shared();
    const preview = page.locator('canvas.click-preview');
    const comes = async () => {
      await point(page, [0.3, 0.3]);
      await point(page, box);
      await expect(preview).not.toHaveAttribute('data-area', '0');
    };
    await comes();
    await page.keyboard.press('Escape');
    await expect(preview).toHaveAttribute('data-area', '0');
    await comes();
    await page.keyboard.press(']');
    await expect(preview).toHaveAttribute('data-area', '0');
    await page.keyboard.press('[');
    await comes();
    await page.mouse.move(4, 4);
    await expect(preview).toHaveAttribute('data-area', '0');
    await comes();
    await page.keyboard.press('u');
    await expect(preview).toHaveAttribute('data-area', '0');
    await page.reload();
    await page.waitForLoadState('networkidle');
    await expect(page.getByLabel('Preview under the pointer')).not.toBeChecked();
    await point(page, [0.3, 0.3]);
    await point(page, box);
    await page.waitForTimeout(1000);
    await expect(preview).toHaveAttribute('data-area', '0');
    await page.getByLabel('Preview under the pointer').check();
    await comes();
  });

  test('the preview follows the pointer', async () => {
    const { page } = shared();
    await page.mouse.move(4, 4);
    const times = (await latencies(page, 40)).sort((a, b) => a - b);
    const quantile = (share: number) => times[Math.floor(share * (times.length - 1))] as number;
    const said = `p50 ${quantile(0.5).toFixed(0)} ms, p95 ${quantile(0.95).toFixed(0)} ms`;
    console.log(`preview, from the pointer's move to the painted outline: ${said}`);
    expect(quantile(0.95)).toBeLessThan(1000);
    await page.mouse.move(4, 4);
    await page.keyboard.press('2');
  });
}
