// The models of a scene: of trainings, of corrections and of edits.
import type { Model } from '../../gen/pepeseg/v1/scene_service_pb';
import { allPages, scenes } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { steadily } from '../api/server_link';
import { Store } from '../store';

export interface VersionsState {
  /** Newest first. */
  readonly list: readonly Model[];
  readonly failure: Failure | undefined;
}

/** Returns what made a model, for people. */
export function versionText({ edit, editedFrom, correctedFrom }: Model): string {
  if (edit !== '') return edit.charAt(0).toUpperCase() + edit.slice(1);
  if (editedFrom !== '') return 'Edited';
  return correctedFrom === '' ? 'Training' : 'Corrected segments';
}

/** Returns whether an edit made a model, or a model that it was made from. */
export function isEdited(list: readonly Model[], name: string): boolean {
  // A model is older than those that are made from it, so that this ends.
  const model = list.find((other) => other.name === name);
  if (!model) return false;
  return model.editedFrom !== '' || (model.correctedFrom !== '' && isEdited(list, model.correctedFrom));
}

export class SceneVersions {
  readonly state = new Store<VersionsState>({ list: [], failure: undefined });

  /** `scene`: name of the scene. */
  constructor(private readonly scene: string) {}

  async load(signal?: AbortSignal): Promise<void> {
    try {
      const list = await allPages(async (pageToken) => {
        const request = { parent: this.scene, pageToken, pageSize: 1000 };
        const page = await steadily(
          () => scenes.listModels(request, signal ? { signal } : {}),
          signal,
        );
        return { items: page.models, nextPageToken: page.nextPageToken };
      });
      this.state.set({ list, failure: undefined });
    } catch (error) {
      if (!signal?.aborted && !isCancelled(error)) this.state.patch({ failure: failureOf(error) });
    }
  }

  /** Throws the server's error. */
  async remove(name: string): Promise<void> {
    await steadily(() => scenes.deleteModel({ name }));
    await this.load();
  }

  closeFailure(): void {
    this.state.patch({ failure: undefined });
  }
}
