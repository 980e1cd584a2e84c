// An upload, from the drop to the training after it. Each step can be repeated: after a reload, a lost
// answer or a lost server the task gets from the server what it has, and resumes.
import { Code, ConnectError } from '@connectrpc/connect';
import { sha256 as digest } from '@noble/hashes/sha2';
import { bytesToHex, utf8ToBytes } from '@noble/hashes/utils';
import { fromJsonString } from '@bufbuild/protobuf';
import type { Upload } from '../../gen/pepeseg/v1/dataset_service_pb';
import { TrainingOptionsSchema } from '../../gen/pepeseg/v1/training_options_pb';
import { datasets, jobs, lastId, scenes } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { Backoff, steadily } from '../api/server_link';
import { Store } from '../store';
import { Digester } from './digest';
import type { UploadFile, UploadRecord } from './file_vault';
import { forget, getFile, putRecord } from './file_vault';
import { sendFile } from './send_file';

export type Phase = 'reading' | 'sending' | 'sealing' | 'done' | 'failed' | 'given up';

export interface UploadState {
  readonly record: UploadRecord;
  readonly phase: Phase;
  /** Bytes that are done in this phase. */
  readonly doneBytes: number;
  readonly totalBytes: number;
  readonly bytesPerSecond: number;
  /** Id of the training that follows. */
  readonly job: string | undefined;
  readonly failure: Failure | undefined;
}

const atOnce = 3;

/** Returns an id that is the same for the same files: dropped again, their upload resumes. */
function requestIdOf(files: readonly UploadFile[]): string {
  const lines = files.map(({ path, kind, size, sha256 }) => `${path}\n${kind} ${size} ${sha256}\n`);
  return `files-${bytesToHex(digest(utf8ToBytes(lines.join(''))))}`;
}

export class UploadTask {
  readonly state: Store<UploadState>;
  private readonly abort = new AbortController();
  private readonly signal = this.abort.signal;

  /** `files`: the dropped files by path, while the page has them. */
  constructor(
    private record: UploadRecord,
    private readonly files = new Map<string, Blob>(),
  ) {
    const totalBytes = record.files.reduce((sum, file) => sum + file.size, 0);
    const start = { phase: 'reading', doneBytes: 0, bytesPerSecond: 0 } as const;
    this.state = new Store({ record, ...start, totalBytes, job: undefined, failure: undefined });
  }

  async run(): Promise<void> {
    this.state.patch({ phase: 'reading', failure: undefined, doneBytes: 0 });
    try {
      await this.digestAll();
      await this.makeScene();
      const dataset = await this.sendAll(await this.openUpload());
      const job = await this.train(dataset);
      await forget(this.record.id).catch(() => undefined);
      this.state.patch({ phase: 'done', job });
    } catch (error) {
      if (this.signal.aborted || isCancelled(error)) this.state.patch({ phase: 'given up' });
      else this.state.patch({ phase: 'failed', failure: failureOf(error) });
    }
  }

  async giveUp(): Promise<void> {
    this.abort.abort();
    this.state.patch({ phase: 'given up' });
    await forget(this.record.id);
  }

  private async fileAt(path: string): Promise<Blob> {
    const file = this.files.get(path) ?? (await getFile(this.record.id, path));
    if (file) return file;
    throw new ConnectError(
      `the browser no longer has ${path}: drop the same files again, and the upload goes on`,
      Code.NotFound,
    );
  }

  private async digestAll(): Promise<void> {
    const digester = new Digester();
    try {
      const files: UploadFile[] = [];
      for (const file of this.record.files) {
        this.signal.throwIfAborted();
        const sha256 = file.sha256 || (await digester.sha256(await this.fileAt(file.path)));
        files.push({ ...file, sha256 });
        this.state.patch({ doneBytes: this.state.get().doneBytes + file.size });
      }
      this.record = { ...this.record, files };
      this.state.patch({ record: this.record });
      await putRecord(this.record).catch(() => undefined);
    } finally {
      digester.end();
    }
  }

  private async makeScene(): Promise<void> {
    const { sceneId, displayName, id } = this.record;
    const request = { sceneId, scene: { displayName }, requestId: id };
    try {
      await steadily(() => scenes.createScene(request, { signal: this.signal }), this.signal);
    } catch (error) {
      // An existing scene gets another dataset.
      if (ConnectError.from(error).code !== Code.AlreadyExists) throw error;
    }
  }

  private openUpload(): Promise<Upload> {
    const { sceneId, files } = this.record;
    const request = {
      parent: `scenes/${sceneId}`,
      requestId: requestIdOf(files),
      files: files.map(({ path, kind, size, sha256 }) => ({
        path,
        kind,
        size: BigInt(size),
        sha256,
      })),
    };
    return steadily(() => datasets.createUpload(request, { signal: this.signal }), this.signal);
  }

  /** Returns the name of the sealed dataset. */
  private async sendAll(upload: Upload): Promise<string> {
    const backoff = new Backoff();
    let now = upload;
    while (!now.sealed) {
      try {
        if (now.missingFiles.length > 0) await this.sendMissing(now);
        this.state.patch({ phase: 'sealing' });
        const sealed = await datasets.sealUpload({ name: now.name }, { signal: this.signal });
        backoff.reset();
        return sealed.name;
      } catch (error) {
        const failure = failureOf(error);
        // The server has not seen an earlier stream's end yet, or has more bytes: get its state again.
        const passes = failure.away || [Code.Aborted, Code.OutOfRange].includes(failure.code);
        if (this.signal.aborted || !passes) throw error;
        await backoff.wait(failure.what, failure.retryMs, this.signal);
      }
      const { name } = now;
      now = await steadily(
        () => datasets.getUpload({ name }, { signal: this.signal }),
        this.signal,
      );
      backoff.reset();
    }
    return upload.name.replace('/uploads/', '/datasets/');
  }

  private async sendMissing(upload: Upload): Promise<void> {
    const sizes = new Map(this.record.files.map(({ path, size }) => [path, size]));
    const offsets = new Map(upload.partialFiles.map((f) => [f.path, Number(f.committedBytes)]));
    const missing = upload.missingFiles;
    const unsent = missing.reduce((sum, path) => sum + (sizes.get(path) ?? 0), 0);
    const sent = new Map(offsets);
    const there = this.state.get().totalBytes - unsent;
    const started = performance.now();
    const before = [...sent.values()].reduce((sum, bytes) => sum + bytes, 0);
    const show = () => {
      const bytes = [...sent.values()].reduce((sum, value) => sum + value, 0);
      const seconds = (performance.now() - started) / 1000;
      const bytesPerSecond = seconds > 1 ? (bytes - before) / seconds : 0;
      this.state.patch({ phase: 'sending', doneBytes: there + bytes, bytesPerSecond });
    };
    show();
    const left = [...missing];
    const sendSome = async (signal: AbortSignal) => {
      for (let path = left.shift(); path !== undefined; path = left.shift()) {
        const at = path;
        const progress = (bytes: number) => {
          sent.set(at, Math.min(bytes, sizes.get(at) ?? bytes));
          show();
        };
        const file = await this.fileAt(path);
        await sendFile({
          upload: upload.name,
          path,
          offset: offsets.get(path) ?? 0,
          file,
          progress,
          signal,
        });
        sent.set(path, file.size);
        show();
      }
    };
    await this.together(sendSome);
  }

  /** Runs `work` on several files at once; the first failure ends the others, too. */
  private async together(work: (signal: AbortSignal) => Promise<void>): Promise<void> {
    const round = new AbortController();
    const stop = () => round.abort();
    this.signal.addEventListener('abort', stop);
    try {
      await Promise.all(Array.from({ length: atOnce }, () => work(round.signal)));
    } finally {
      stop();
      this.signal.removeEventListener('abort', stop);
    }
  }

  /** Returns the id of the job; undefined if none was wanted. */
  private async train(dataset: string): Promise<string | undefined> {
    const { training, sceneId, id } = this.record;
    if (training === undefined) return undefined;
    const options = fromJsonString(TrainingOptionsSchema, training);
    const request = { scene: `scenes/${sceneId}`, dataset, options, requestId: id };
    const job = await steadily(
      () => jobs.trainScene(request, { signal: this.signal }),
      this.signal,
    );
    return lastId(job.name);
  }
}
