// The files that nerfstudio's transforms.json names besides photographs, by the rule of the other
// clients (clients/cpp/dataset_folder.cc).
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';

/** Returns the path with '/' and without ".", ".." and empty parts, as the server reads it. */
function plainPath(path: string): string {
  const parts = path.replace(/\\/g, '/').split('/');
  return parts.filter((part) => part !== '' && part !== '.' && part !== '..').join('/');
}

function isObject(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function parse(text: string): unknown {
  try {
    // Editors of Windows write a byte order mark, which JSON.parse refuses.
    return JSON.parse(text.replace(/^\ufeff/, ''));
  } catch {
    return undefined; // it names no files; the server says what is wrong
  }
}

/**
 * Returns the kind of each file that transforms.json names by `mask_path` or `ply_file_path`, by path
 * in lower case: names may differ from those of the files in the case of letters.
 * The masks are sent as MASK: the server finds them by the same references, ignores their pixels of
 * value 0, and never takes them for segments.
 */
export function transformsReferences(text: string): ReadonlyMap<string, FileKind> {
  const named = new Map<string, FileKind>();
  const document = parse(text);
  if (!isObject(document)) return named;
  const add = (path: unknown, kind: FileKind) => {
    if (typeof path === 'string') named.set(plainPath(path).toLowerCase(), kind);
  };
  const { frames } = document;
  for (const frame of [document, ...(Array.isArray(frames) ? frames : [])]) {
    if (isObject(frame)) add(frame['mask_path'], FileKind.MASK);
  }
  add(document['ply_file_path'], FileKind.POINTS);
  return named;
}
