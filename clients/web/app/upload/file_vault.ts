// What an upload needs to resume after a reload, in the browser's database. It includes the files
// themselves, because a reloaded page no longer has the files that were dropped on it.
import type { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';

export interface UploadFile {
  readonly path: string;
  readonly kind: FileKind;
  readonly size: number;
  /** SHA-256; empty: not computed yet. */
  readonly sha256: string;
  /** True for a MASK whose pixels of value 0 are ignored. */
  readonly ignores?: boolean;
}

export interface UploadRecord {
  readonly id: string;
  readonly sceneId: string;
  readonly displayName: string;
  readonly files: readonly UploadFile[];
  /** TrainingOptions as JSON; undefined: nothing is trained afterwards. */
  readonly training: string | undefined;
  readonly createTime: number;
  /** Whether the vault has the files. */
  readonly kept: boolean;
}

const name = 'pepeseg-uploads';

function open(): Promise<IDBDatabase> {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(name, 1);
    request.onupgradeneeded = () => {
      request.result.createObjectStore('uploads', { keyPath: 'id' });
      request.result.createObjectStore('files');
    };
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

type Mode = 'readonly' | 'readwrite';

async function within<T>(
  mode: Mode,
  act: (uploads: IDBObjectStore, files: IDBObjectStore) => IDBRequest<T>,
): Promise<T> {
  const database = await open();
  try {
    return await new Promise<T>((resolve, reject) => {
      const transaction = database.transaction(['uploads', 'files'], mode);
      const request = act(transaction.objectStore('uploads'), transaction.objectStore('files'));
      transaction.oncomplete = () => resolve(request.result);
      transaction.onerror = () => reject(transaction.error);
      transaction.onabort = () => reject(transaction.error);
    });
  } finally {
    database.close();
  }
}

export function putRecord(record: UploadRecord): Promise<IDBValidKey> {
  return within('readwrite', (uploads) => uploads.put(record));
}

export function putFile(id: string, path: string, file: Blob): Promise<IDBValidKey> {
  return within('readwrite', (_, files) => files.put(file, [id, path]));
}

export function getFile(id: string, path: string): Promise<Blob | undefined> {
  return within('readonly', (_, files) => files.get([id, path]) as IDBRequest<Blob | undefined>);
}

export function allRecords(): Promise<UploadRecord[]> {
  return within('readonly', (uploads) => uploads.getAll() as IDBRequest<UploadRecord[]>);
}

export async function forget(id: string): Promise<void> {
  await within('readwrite', (uploads, files) => {
    // Arrays sort after strings: the range from [id] to [id, []] has all paths of the upload.
    files.delete(IDBKeyRange.bound([id], [id, []]));
    return uploads.delete(id);
  });
}
