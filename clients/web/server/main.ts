import { writeFileSync } from 'node:fs';
import type { AddressInfo } from 'node:net';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { openChannel } from './channel';
import { ConfigError, readConfig, usage } from './config';
import { createWebServer } from './web_server';

function run(): void {
  if (process.argv.includes('--help')) {
    console.log(usage);
    return;
  }
  const here = dirname(fileURLToPath(import.meta.url));
  const config = readConfig(process.argv.slice(2), process.env, join(here, '../app'));
  const server = createWebServer(config, {
    channel: openChannel(config),
  });
  server.on('error', (error) => {
    console.error(`pepeseg-web: ${error.message}`);
    process.exit(1);
  });
  server.listen(config.listenPort, config.listenHost, () => {
    const { port } = server.address() as AddressInfo;
    const host = config.listenHost.includes(':') ? `[${config.listenHost}]` : config.listenHost;
    if (config.portFile) writeFileSync(config.portFile, String(port));
    console.log(`pepeseg: open http://${host}:${port} (server: ${config.serverUrl})`);
  });
  const stop = () => {
    server.close(() => process.exit(0));
    server.closeAllConnections();
  };
  process.on('SIGTERM', stop);
  process.on('SIGINT', stop);
}

try {
  run();
} catch (error) {
  if (!(error instanceof ConfigError)) throw error;
  console.error(`pepeseg-web: ${error.message}`);
  process.exit(2);
}
