// Clients of the server's services, through the back end that served the app.
import { createClient } from '@connectrpc/connect';
import { createConnectTransport } from '@connectrpc/connect-web';
import { DatasetService } from '../../gen/pepeseg/v1/dataset_service_pb';
import { EditService } from '../../gen/pepeseg/v1/edit_service_pb';
import { JobService } from '../../gen/pepeseg/v1/job_service_pb';
import { LabelService } from '../../gen/pepeseg/v1/label_service_pb';
import type { GaussianFormat, MeshFormat } from '../../gen/pepeseg/v1/render_service_pb';
import { SceneService } from '../../gen/pepeseg/v1/scene_service_pb';
import { SegmentationService } from '../../gen/pepeseg/v1/segmentation_service_pb';
import { SelectionService } from '../../gen/pepeseg/v1/selection_service_pb';

const transport = createConnectTransport({ baseUrl: '/api/rpc', useBinaryFormat: true });

export const scenes = createClient(SceneService, transport);
export const datasets = createClient(DatasetService, transport);
export const jobs = createClient(JobService, transport);
export const segmentation = createClient(SegmentationService, transport);
export const labels = createClient(LabelService, transport);
export const selections = createClient(SelectionService, transport);
export const editing = createClient(EditService, transport);

/** Returns the items of all pages of a list. */
export async function allPages<T>(
  ask: (pageToken: string) => Promise<{ items: T[]; nextPageToken: string }>,
): Promise<T[]> {
  const all: T[] = [];
  let token = '';
  do {
    const page = await ask(token);
    all.push(...page.items);
    token = page.nextPageToken;
  } while (token !== '');
  return all;
}

/** Returns the scene's id: "scenes/shelf/models/3" -> "shelf". */
export function sceneIdOf(resource: string): string {
  return resource.split('/')[1] ?? '';
}

/** Returns the last part of a name: "jobs/17" -> "17", "scenes/x/labels/cup" -> "cup". */
export function lastId(resource: string): string {
  return resource.slice(resource.lastIndexOf('/') + 1);
}

/** Returns a random id, by which the server recognises a call repeated after a lost answer. */
export function newRequestId(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}

function query(values: Record<string, string | undefined>): string {
  const given = Object.entries(values).filter((pair): pair is [string, string] => !!pair[1]);
  return new URLSearchParams(given).toString();
}

/** Returns the URL of a rendering. `maxSide`: maximum of its longer side, pixels; absent: none. */
export function pictureUrl(model: string, view: string, maxSide?: number): string {
  return `/api/picture?${query({ model, view, max_side: maxSide?.toString() })}`;
}

export interface PhotoOptions {
  /** Name as in View.view; absent: the first photograph. */
  name?: string;
  /** Maximum of the longer side, pixels; absent: none. */
  maxSide?: number;
}

/** Returns the URL of a photograph of a dataset, or of a model's dataset. */
export function photoUrl(parent: string, { name, maxSide }: PhotoOptions = {}): string {
  return `/api/photo?${query({ parent, name, max_side: maxSide?.toString() })}`;
}

/** Returns the URL of the ids of a view's segments, as 16-bit grey. */
export function segmentsUrl(model: string, view: string, level: number): string {
  return `/api/picture?${query({ model, view, content: 'segments', level: level.toString() })}`;
}

export interface PlyOptions {
  selection?: string;
  /** A segment of the decomposition at the default scales. */
  segment?: { readonly level: number; readonly id: number };
  complement?: boolean;
  /** Absent: PLY. */
  format?: GaussianFormat;
}

export function plyUrl(model: string, options: PlyOptions = {}): string {
  const { selection, segment, complement } = options;
  const format = options.format?.toString();
  const of = { selection, segment: segment?.id.toString(), level: segment?.level.toString() };
  return `/api/ply?${query({ model, ...of, complement: complement ? '1' : '', format })}`;
}

export interface MeshOptions {
  selection?: string;
  format: MeshFormat;
  /** Whether the surface is closed. */
  watertight: boolean;
}

export function meshUrl(model: string, { selection, format, watertight }: MeshOptions): string {
  const how = { format: format.toString(), watertight: watertight ? '1' : '' };
  return `/api/mesh?${query({ model, selection, ...how })}`;
}
