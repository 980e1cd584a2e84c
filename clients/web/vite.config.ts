import { defineConfig } from 'vite';

// Two builds: the app (`vite build`) and the back end (`vite build --ssr server/main.ts`), whose
// packages are bundled with it, so that what runs needs no node_modules.
export default defineConfig(({ isSsrBuild }) => ({
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  worker: { format: 'es' },
  ssr: { noExternal: true },
  build: isSsrBuild
    ? { target: 'node18', outDir: 'dist/server', emptyOutDir: true }
    : { target: 'es2022', outDir: 'dist/app', chunkSizeWarningLimit: 4000 },
}));
