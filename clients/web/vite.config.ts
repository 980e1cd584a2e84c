import { defineConfig } from 'vite';

// Two builds: the app (`vite build`) and the back end (`vite build --ssr server/main.ts`), whose
// packages are bundled with it, so that what runs needs no node_modules.
export default defineConfig(({ isSsrBuild }) => ({
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  worker: { format: 'es' },
  ssr: { noExternal: true },
  // ws looks for native add-ons that do not exist; it would call a bundler's stand-in for them.
  define: isSsrBuild
    ? { 'process.env.WS_NO_BUFFER_UTIL': '"1"', 'process.env.WS_NO_UTF_8_VALIDATE': '"1"' }
    : {},
  build: isSsrBuild
    ? { target: 'node18', outDir: 'dist/server', emptyOutDir: true }
    : { target: 'es2022', outDir: 'dist/app', chunkSizeWarningLimit: 4000 },
}));
