// The views of the model that a screen shows.
import { equals } from '@bufbuild/protobuf';
import { useRef } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { ViewSchema } from '../../gen/pepeseg/v1/scene_service_pb';
import { allPages, scenes } from '../api/clients';
import type { Asked } from '../api/use_asked';
import { useAsked } from '../api/use_asked';

export interface ModelViews {
  readonly model: string;
  readonly views: readonly View[];
}

/** Returns all views of a model, or of a job that trains. */
async function allViews(model: string, signal: AbortSignal): Promise<View[]> {
  return allPages(async (pageToken) => {
    const page = await scenes.listViews({ parent: model, pageToken, pageSize: 1000 }, { signal });
    return { items: page.views, nextPageToken: page.nextPageToken };
  });
}

function withoutScores({ scores: _, ...view }: View): View {
  return view;
}

/** Returns whether two models have the same views, whatever they score in them. */
export function sameViews(a: readonly View[], b: readonly View[]): boolean {
  return (
    a.length === b.length &&
    a.every((view, i) => equals(ViewSchema, withoutScores(view), withoutScores(b[i] as View)))
  );
}

/**
 * Asks for the views of a model. Those of the model before it stay until they are there, and for good if they are
 * the same, so that the 3D view stays where it is.
 */
export function useModelViews(model: string): Asked<ModelViews> {
  const before = useRef<readonly View[]>([]);
  return useAsked(
    async (signal) => {
      const views = await allViews(model, signal);
      if (!sameViews(before.current, views)) before.current = views;
      return { model, views: before.current };
    },
    [model],
  );
}
