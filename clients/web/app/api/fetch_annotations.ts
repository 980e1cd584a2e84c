// The masks of all things in all photographs, as the files of an annotation tool, in one zip. The server
// reports each mask while it makes them, and sends the zip then.
import type { MessageInitShape } from '@bufbuild/protobuf';
import { Code, ConnectError } from '@connectrpc/connect';
import { sha256 } from '@noble/hashes/sha2';
import { bytesToHex } from '@noble/hashes/utils';
import type {
  ExportAnnotationsRequestSchema,
  ExportAnnotationsResponse_Header,
} from '../../gen/pepeseg/v1/label_service_pb';
import { labels } from './clients';
import { GrowingFile } from './growing_file';
import { serverAnswers, steadily } from './server_link';

export type AnnotationsRequest = MessageInitShape<typeof ExportAnnotationsRequestSchema>;

export interface AnnotationsWatch {
  /** Called with masks. May throw to end the export. */
  readonly made: (done: number, total: number) => void;
  /** Called with bytes. May throw to end the export. */
  readonly received: (done: number, total: number) => void;
  readonly signal: AbortSignal;
}

async function fetchOnce(request: AnnotationsRequest, watch: AnnotationsWatch): Promise<Blob> {
  const { made, received, signal } = watch;
  const file = new GrowingFile();
  const hash = sha256.create();
  let header: ExportAnnotationsResponse_Header | undefined;
  made(0, 0);
  for await (const { part } of labels.exportAnnotations(request, { signal })) {
    serverAnswers();
    if (part.case === 'progress') {
      made(Number(part.value.numMasksDone), Number(part.value.numMasks));
    } else if (part.case === 'header') {
      header = part.value;
    } else if (part.case === 'chunk') {
      file.add(part.value as Uint8Array<ArrayBuffer>);
      hash.update(part.value);
      received(file.size, Number(header?.numBytes ?? 0));
    }
  }
  if (BigInt(file.size) !== header?.numBytes) {
    const expected = header ? `${header.numBytes}` : 'an unknown number';
    throw new ConnectError(`the zip has ${file.size} bytes instead of ${expected}`, Code.DataLoss);
  }
  if (bytesToHex(hash.digest()) !== header.sha256) {
    throw new ConnectError('the zip was damaged on the way: its SHA-256 is another', Code.DataLoss);
  }
  return file.whole('application/zip');
}

/**
 * Returns the zip. The request is repeated while the server is away; a zip that is cut off or damaged is
 * DATA_LOSS.
 */
export function fetchAnnotations(
  request: AnnotationsRequest,
  watch: AnnotationsWatch,
): Promise<Blob> {
  return steadily(() => fetchOnce(request, watch), watch.signal);
}
