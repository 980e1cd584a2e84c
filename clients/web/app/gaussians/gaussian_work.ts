// Calls of the worker that reads Gaussians and finds floaters.
import type { SightOfPhotograph } from './floaters';
import type { GaussianPly } from './gaussian_ply';
import type { GaussianSet } from './gaussian_set';
import type { WorkAnswer, WorkRequest } from './gaussian_worker';

export interface GaussianWork {
  read(file: Blob): Promise<GaussianPly>;
  floaters(
    gaussians: GaussianPly,
    photographs: readonly SightOfPhotograph[],
  ): Promise<GaussianSet>;
  end(): void;
}

/** Starts the worker at the first call. */
export class WorkInWorker implements GaussianWork {
  private worker: Worker | undefined;
  private readonly waiting = new Map<number, (answer: WorkAnswer) => void>();
  private next = 0;

  async read(file: Blob): Promise<GaussianPly> {
    return (await this.ask({ id: this.next++, file })) as GaussianPly;
  }

  async floaters(
    gaussians: GaussianPly,
    photographs: readonly SightOfPhotograph[],
  ): Promise<GaussianSet> {
    return (await this.ask({ id: this.next++, gaussians, photographs })) as GaussianSet;
  }

  end(): void {
    this.worker?.terminate();
    this.worker = undefined;
    this.waiting.clear();
  }

  private async ask(request: WorkRequest): Promise<WorkAnswer['value']> {
    const worker = (this.worker ??= this.start());
    const answer = await new Promise<WorkAnswer>((resolve) => {
      this.waiting.set(request.id, resolve);
      worker.postMessage(request);
    });
    if (answer.error !== undefined) throw new Error(answer.error);
    return answer.value;
  }

  private start(): Worker {
    const worker = new Worker(new URL('./gaussian_worker.ts', import.meta.url), { type: 'module' });
    worker.onmessage = ({ data }: MessageEvent<WorkAnswer>) => {
      this.waiting.get(data.id)?.(data);
      this.waiting.delete(data.id);
    };
    return worker;
  }
}
