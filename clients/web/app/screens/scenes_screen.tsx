// All scenes as cards. Photographs that are dropped anywhere on it begin a new one.
import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import type { Scene } from '../../gen/pepeseg/v1/scene_service_pb';
import { allPages, scenes } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import { useAsked } from '../api/use_asked';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import { Icon } from '../components/icons';
import { goTo, Link } from '../router';
import { useStore } from '../store';
import type { DroppedFile } from '../upload/dataset_files';
import { keepDropped } from '../upload/dropped_later';
import { uploads } from '../upload/uploads';
import { usePageDrop } from '../upload/use_drop';
import { FirstSteps } from './first_steps';
import { isSample, sampleOf } from './sample_scene';
import { followMs, SceneCard, UploadCard } from './scene_card';

function begin(files: readonly DroppedFile[]): void {
  if (files.length === 0) return;
  keepDropped(files);
  goTo('/new');
}

async function allScenes(signal: AbortSignal): Promise<Scene[]> {
  return allPages(async (pageToken) => {
    const page = await scenes.listScenes({ pageToken, pageSize: 200 }, { signal });
    return { items: page.scenes, nextPageToken: page.nextPageToken };
  });
}

export function ScenesScreen(): JSX.Element {
  const list = useAsked(allScenes, []);
  const sending = useStore(uploads);
  const [failure, setFailure] = useState<Failure>();
  const remove = async ({ name }: Scene) => {
    setFailure(undefined);
    try {
      await steadily(() => scenes.deleteScene({ name }));
    } catch (error) {
      setFailure(failureOf(error));
    }
    list.ask();
  };
  const active = list.value?.some((scene) => scene.activeJob);
  useEffect(() => {
    if (!active) return undefined;
    const timer = setInterval(list.ask, followMs);
    return () => clearInterval(timer);
  }, [active]);
  const newest = [...(list.value ?? [])].sort((a, b) =>
    Number((b.createTime?.seconds ?? 0n) - (a.createTime?.seconds ?? 0n)),
  );
  // The sample is nobody's own scene.
  const isFirst = list.value?.every(isSample) && sending.length === 0;
  const isOver = usePageDrop(begin);
  return (
    <div class={`screen wide ${isOver ? 'drop-target' : ''}`}>
      <Header title="Scenes">
        <Link to="/new" class="button primary">
          <Icon name="plus" />
          New scene
        </Link>
      </Header>
      <main>
        <FailureNote failure={failure ?? list.failure} again={list.failure && list.ask} />
        {!list.value && !list.failure && (
          <p class="loading" role="status">
            Asking for the scenes …
          </p>
        )}
        {isFirst && <FirstSteps sample={sampleOf(newest)} onFiles={begin} />}
        <div class="cards">
          {sending.map((task) => (
            <UploadCard key={task.state.get().record.id} task={task} />
          ))}
          {newest.map((scene) => (
            <SceneCard key={scene.name} scene={scene} onDelete={() => void remove(scene)} />
          ))}
        </div>
      </main>
    </div>
  );
}
