// The uploads of this page: those that it began, and those that an earlier page left unfinished.
import { newRequestId } from '../api/clients';
import { Store } from '../store';
import type { DatasetFile } from './dataset_files';
import type { UploadRecord } from './file_vault';
import { allRecords, putFile, putRecord } from './file_vault';
import { UploadTask } from './upload_task';

export const uploads = new Store<readonly UploadTask[]>([]);
/** False until the browser's database was read. */
export const uploadsKnown = new Store(false);

export interface NewUpload {
  sceneId: string;
  displayName: string;
  files: readonly DatasetFile[];
  /** TrainingOptions as JSON; undefined: nothing is trained afterwards. */
  training: string | undefined;
}

/** Lets one page of the browser send at a time; when it closes, another one resumes. */
function start(task: UploadTask): void {
  uploads.set([...uploads.get(), task]);
  const { id } = task.state.get().record;
  const locks = (navigator as { locks?: LockManager }).locks; // only over HTTPS or on this machine
  if (locks) void locks.request(`pepeseg-upload-${id}`, () => task.run());
  else void task.run();
}

/** Copies the files for a page after a reload. Returns false if there is no room. */
async function keep(record: UploadRecord, files: readonly DatasetFile[]): Promise<boolean> {
  try {
    for (const { path, file } of files) await putFile(record.id, path, file);
    await putRecord(record);
    return true;
  } catch {
    return false;
  }
}

export async function beginUpload(upload: NewUpload): Promise<UploadTask> {
  const { files, sceneId, displayName, training } = upload;
  const listed = files.map(({ file, ...rest }) => ({ ...rest, size: file.size, sha256: '' }));
  const id = newRequestId();
  const record = {
    id,
    sceneId,
    displayName,
    training,
    files: listed,
    createTime: Date.now(),
    kept: true,
  };
  const kept = await keep(record, files);
  const blobs = new Map(files.map(({ path, file }) => [path, file]));
  const task = new UploadTask({ ...record, kept }, blobs);
  start(task);
  return task;
}

export async function resumeUploads(): Promise<void> {
  const records = await allRecords().catch(() => []);
  const known = new Set(uploads.get().map((task) => task.state.get().record.id));
  for (const record of records) if (!known.has(record.id)) start(new UploadTask(record));
  uploadsKnown.set(true);
}

export function dropUpload(task: UploadTask): void {
  uploads.set(uploads.get().filter((other) => other !== task));
}
