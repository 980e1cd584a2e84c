// A training: followed through a reload and a restart, clicked in before its end, and its model after it.
import type { Page } from '@playwright/test';
import { expect, test } from '@playwright/test';
import { clickView, numAnswers, numSizes, picturesOf, screenshot, settled } from './on_screen';
import type { Stack } from './stack';

interface Shared {
  readonly stack: Stack;
  readonly page: Page;
}

/** Calls a method of the server's JobService from the page. */
async function call(page: Page, method: string, request: object): Promise<{ name: string }> {
  const answer = await page.evaluate(
    async ([path, body]) => {
      const headers = { 'content-type': 'application/json' };
      const response = await fetch(path, { method: 'POST', headers, body });
      return { ok: response.ok, text: await response.text() };
    },
    [`/api/rpc/pepeseg.v1.JobService/${method}`, JSON.stringify(request)] as const,
  );
  expect(answer.ok, answer.text).toBe(true);
  return JSON.parse(answer.text) as { name: string };
}

/** Adds the tests. `shared` returns the page, with a training on it that has just begun. */
export function testTraining(shared: () => Shared): void {
  const book: readonly [number, number] = [0.27, 0.6];
  let address = '';

  test('a training is followed after a reload and a restart of the server', async () => {
    test.setTimeout(1_200_000);
    const { stack, page } = shared();
    address = page.url();
    const psnr = page.locator('.curve', { hasText: 'PSNR' });
    const numSamples = async () => Number(await psnr.getAttribute('data-samples'));
    await expect.poll(numSamples, { timeout: 300_000 }).toBeGreaterThan(4);
    const before = await numSamples();
    const first = (await psnr.getAttribute('data-first')) ?? '';
    const picture = page.getByRole('img', { name: /as it is being trained: step [\d,]+ of [\d,]+$/ });
    await expect(picture).toBeVisible();
    await expect(page.locator('.training-picture figcaption')).toHaveText(/^step .* of .*, after \d+ s$/);
    await page.reload();
    // The page keeps earlier events in its store, because the server sends each one once.
    await expect(picture).toBeVisible();
    await expect(picture).toHaveJSProperty('complete', true);
    await expect.poll(numSamples, { timeout: 30_000 }).toBeGreaterThanOrEqual(before);
    await expect(psnr).toHaveAttribute('data-first', first);
    await expect(page.locator('.time-left')).toHaveText(/ left$/);
    const shown = await page.locator('.training-picture img').boundingBox();
    expect(shown?.width, 'the picture is large').toBeGreaterThan(600);
    await picturesOf(page, 'training');

    await stack.killServer();
    await expect(page.getByText('The server does not answer.')).toBeVisible({ timeout: 30_000 });
    await screenshot(page, 'server-away-1440');
    await stack.startServer();
    await expect(page.getByText('The server does not answer.')).toBeHidden({ timeout: 30_000 });
  });

  test('clicks are answered while it trains', async () => {
    test.setTimeout(900_000);
    const { page } = shared();
    const link = page.getByRole('link', { name: 'Try clicks now' });
    await expect(link).toBeVisible({ timeout: 600_000 });
    await screenshot(page, 'training-answers-clicks-1440');
    await link.click();
    await expect(page.getByText(/^Still training: stage segment features, step/)).toBeVisible();
    const picture = page.locator('.picture');
    await expect(picture).toHaveAttribute('data-view', 'frame-000000.jpg');
    await page.keyboard.press(']');
    await expect(picture).toHaveAttribute('data-view', 'frame-000001.jpg');
    const edges = await picture.boundingBox();
    if (!edges) throw new Error('no view on the screen');
    await page.mouse.move(edges.x + book[0] * edges.width, edges.y + book[1] * edges.height);
    await expect(page.locator('canvas.click-preview')).not.toHaveAttribute('data-area', '0');
    const before = await numAnswers(page);
    await clickView(page, book);
    await settled(page, before);
    await expect(picture).not.toHaveAttribute('data-area', '0');
    await numSizes(page);
    await expect(page.getByText('Seen in')).toBeVisible({ timeout: 60_000 });
    await expect(page.getByRole('heading', { name: 'After the training' })).toBeVisible();
    await expect(page.getByRole('button', { name: '3D' })).toBeDisabled();
    await expect(page.getByRole('alert')).toHaveCount(0);
    await expect(page.getByText(/^Still training/), 'the training lasts long enough').toBeVisible();
    await picturesOf(page, 'early-clicks');
  });

  test('the finished model takes the place of the training, with view and prompt', async () => {
    test.setTimeout(900_000);
    const { page } = shared();
    await expect(page.getByText('this is its model')).toBeVisible({ timeout: 800_000 });
    await expect(page).toHaveURL(/\/scenes\/Kitchen-shelf/);
    const picture = page.locator('.picture');
    await expect(picture).toHaveAttribute('data-view', 'frame-000001.jpg');
    await expect(page.locator('.mark')).toHaveCount(1);
    await expect(picture).not.toHaveAttribute('data-area', '0', { timeout: 30_000 });
    await expect(page.locator('.splats[data-status=ready]')).toBeVisible({ timeout: 60_000 });
    await expect(page.getByPlaceholder('Name this segment')).toBeEnabled();
    await page.goto(address);
    await expect(page.getByText('The scene is ready.')).toBeVisible();
    await picturesOf(page, 'training-done');
  });

  test('a training that is cancelled says so to who clicks in it', async () => {
    test.setTimeout(300_000);
    const { stack, page } = shared();
    const scene = 'scenes/Kitchen-shelf';
    const options = { reconstruct: { numSteps: 60 }, features: { numSteps: 1_000_000 } };
    const { name } = await call(page, 'TrainScene', {
      scene,
      dataset: `${scene}/datasets/1`,
      options: { preset: 'TRAINING_PRESET_PREVIEW', ...options },
    });
    await page.goto(`${stack.url}/${name}/clicks`);
    // Nothing answers yet: the page waits, and the server is not away.
    await expect(page.getByText('Waiting for the first state of the training')).toBeVisible();
    await expect(page.locator('.away')).toHaveCount(0);
    await expect(page.locator('.picture')).toBeVisible({ timeout: 120_000 });
    await clickView(page, book);
    await settled(page, 0);
    await call(page, 'CancelJob', { name });
    await expect(page.getByText('The training was cancelled in the stage')).toBeVisible();
    await expect(page.locator('.workbench')).toHaveCount(0);
    await picturesOf(page, 'early-clicks-cancelled');
    await page.goto(address);
  });
}
