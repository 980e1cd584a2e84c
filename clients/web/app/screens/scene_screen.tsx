// A scene with a model: its views, its 3D view, and their segmentation.
import type { JSX } from 'preact';
import type { Scene, View } from '../../gen/pepeseg/v1/scene_service_pb';
import { allPages, scenes } from '../api/clients';
import { useAsked } from '../api/use_asked';
import { Advice } from '../components/advice';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import type { Layout } from '../scene/layout';
import { useLayout } from '../scene/layout';
import { LayoutSwitch } from '../scene/layout_switch';
import { SceneWorkbench } from '../scene/workbench';
import { adviceOnModel } from './mask_advice';
import { SceneWithoutModel } from './scene_without_model';

/** Returns all views of a model, or of a job that trains. */
export async function allViews(model: string, signal: AbortSignal): Promise<View[]> {
  return allPages(async (pageToken) => {
    const page = await scenes.listViews({ parent: model, pageToken, pageSize: 1000 }, { signal });
    return { items: page.views, nextPageToken: page.nextPageToken };
  });
}

interface WithModelProps {
  scene: Scene;
  layout: Layout;
}

function SceneWithModel({ scene, layout }: WithModelProps): JSX.Element {
  const views = useAsked((signal) => allViews(scene.liveModel, signal), [scene.liveModel]);
  const model = useAsked(
    (signal) => scenes.getModel({ name: scene.liveModel }, { signal }),
    [scene.liveModel],
  );
  if (views.failure) return <FailureNote failure={views.failure} again={views.ask} />;
  if (!views.value)
    return (
      <p class="loading" role="status">
        Loading the model …
      </p>
    );
  const subject = { scene: scene.name, model: scene.liveModel, photos: scene.liveModel };
  const advice = model.value && adviceOnModel(model.value);
  return (
    <>
      <Advice key={scene.liveModel} about={scene.liveModel} text={advice} />
      <SceneWorkbench subject={subject} views={views.value} layout={layout} />
    </>
  );
}

export function SceneScreen({ sceneId }: { sceneId: string }): JSX.Element {
  const scene = useAsked(
    (signal) => scenes.getScene({ name: `scenes/${sceneId}` }, { signal }),
    [sceneId],
  );
  const layout = useLayout();
  const title = scene.value?.displayName || sceneId;
  return (
    <div class="screen wide">
      <Header title={title} back="/">
        {scene.value?.liveModel && <LayoutSwitch layout={layout} />}
      </Header>
      <main>
        <FailureNote failure={scene.failure} again={scene.ask} />
        {scene.value?.liveModel && <SceneWithModel scene={scene.value} layout={layout} />}
        {scene.value && !scene.value.liveModel && (
          <SceneWithoutModel scene={scene.value} again={scene.ask} />
        )}
      </main>
    </div>
  );
}
