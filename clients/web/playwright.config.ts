import { defineConfig } from '@playwright/test';

// `unit` needs node only; `e2e` starts a server, the back end and Chromium, and trains a scene.
export default defineConfig({
  outputDir: 'test-results',
  reporter: [['list']],
  workers: 1,
  retries: 0,
  projects: [
    { name: 'unit', testDir: 'tests/unit' },
    {
      name: 'e2e',
      testDir: 'tests/e2e',
      timeout: 120_000,
      expect: { timeout: 15_000 },
      use: {
        viewport: { width: 1440, height: 900 },
        launchOptions: {
          executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
          // Without a GPU: WebGL by SwiftShader, the page itself drawn by Skia as on any such machine
          // (by SwiftShader a picture takes 160 ms of a core). The sandbox wants user namespaces,
          // which containers do not give.
          args: [
            '--no-sandbox',
            '--use-gl=angle',
            '--use-angle=swiftshader',
            '--enable-unsafe-swiftshader',
            '--disable-gpu-compositing',
            '--disable-gpu-rasterization',
            '--disable-accelerated-2d-canvas',
          ],
        },
      },
    },
  ],
});
