// A scene with a model: its views, its 3D view, and their segmentation.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { Scene } from '../../gen/pepeseg/v1/scene_service_pb';
import { scenes } from '../api/clients';
import { useAsked } from '../api/use_asked';
import { Advice } from '../components/advice';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import type { Layout } from '../scene/layout';
import { useLayout } from '../scene/layout';
import { LayoutSwitch } from '../scene/layout_switch';
import { SceneWorkbench } from '../scene/workbench';
import { adviceOnModel } from './mask_advice';
import { useModelViews } from './model_views';
import { SceneWithoutModel } from './scene_without_model';

interface WithModelProps {
  scene: Scene;
  layout: Layout;
}

function SceneWithModel({ scene, layout }: WithModelProps): JSX.Element {
  /** Model that was made, or chosen, on this screen. */
  const [chosen, setChosen] = useState('');
  const { value, failure, ask } = useModelViews(chosen || scene.liveModel);
  const shown = value?.model ?? '';
  const model = useAsked(
    async (signal) => (shown ? scenes.getModel({ name: shown }, { signal }) : undefined),
    [shown],
  );
  if (failure) return <FailureNote failure={failure} again={ask} />;
  if (!value)
    return (
      <p class="loading" role="status">
        Loading the model …
      </p>
    );
  const subject = { scene: scene.name, model: shown, photos: shown };
  const advice = model.value && adviceOnModel(model.value);
  return (
    <>
      <Advice key={shown} about={shown} text={advice} />
      <SceneWorkbench subject={subject} views={value.views} layout={layout} onModel={setChosen} />
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
