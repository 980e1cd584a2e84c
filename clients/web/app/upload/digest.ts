import type { DigestAnswer, DigestRequest } from './digest_worker';

/** Computes digests in a web worker, so that the page stays responsive. */
export class Digester {
  private readonly worker = new Worker(new URL('./digest_worker.ts', import.meta.url), {
    type: 'module',
  });
  private readonly waiting = new Map<number, (answer: DigestAnswer) => void>();
  private next = 0;

  constructor() {
    this.worker.onmessage = ({ data }: MessageEvent<DigestAnswer>) => {
      this.waiting.get(data.id)?.(data);
      this.waiting.delete(data.id);
    };
  }

  async sha256(file: Blob): Promise<string> {
    const id = this.next++;
    const answer = await new Promise<DigestAnswer>((resolve) => {
      this.waiting.set(id, resolve);
      this.worker.postMessage({ id, file } satisfies DigestRequest);
    });
    if (answer.error) throw new Error(answer.error);
    return answer.sha256;
  }

  end(): void {
    this.worker.terminate();
  }
}
