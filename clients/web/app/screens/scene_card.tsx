// Scenes and uploads as cards: picture, state, size.
import type { JSX } from 'preact';
import { useEffect } from 'preact/hooks';
import type { Job } from '../../gen/pepeseg/v1/job_service_pb';
import { JobStage, JobState } from '../../gen/pepeseg/v1/job_service_pb';
import type { Model, Scene } from '../../gen/pepeseg/v1/scene_service_pb';
import { jobs, lastId, scenes } from '../api/clients';
import { useAsked } from '../api/use_asked';
import { ConfirmButton } from '../components/confirm_button';
import { Icon } from '../components/icons';
import { ScenePhoto } from '../components/photo';
import { bytesText, countText, dateText } from '../format';
import { Link } from '../router';
import { useStore } from '../store';
import { outcomeOf, stageName } from '../training/job_states';
import type { UploadTask } from '../upload/upload_task';
import { shareOf } from './upload_screen';

interface Known {
  readonly model: Model | undefined;
  readonly view: string;
  readonly job: Job | undefined;
}

async function know(scene: Scene, signal: AbortSignal): Promise<Known> {
  const [model, views, job, last] = await Promise.all([
    scene.liveModel ? scenes.getModel({ name: scene.liveModel }, { signal }) : undefined,
    scene.liveModel
      ? scenes.listViews({ parent: scene.liveModel, pageSize: 1 }, { signal })
      : undefined,
    scene.activeJob ? jobs.getJob({ name: scene.activeJob }, { signal }) : undefined,
    // The last job, which says why there is no model or no newer one.
    scene.activeJob ? undefined : jobs.listJobs({ scene: scene.name, pageSize: 1 }, { signal }),
  ]);
  return { model, view: views?.views[0]?.view ?? '', job: job ?? last?.jobs[0] };
}

function stateOf(scene: Scene, job: Job | undefined): string {
  if (scene.activeJob) {
    const { step = 0n, numSteps = 0n } = job?.progress ?? {};
    const share =
      numSteps > 0n
        ? ` – ${stageName(job?.stage ?? JobStage.UNSPECIFIED)}, ${Math.round((100 * Number(step)) / Number(numSteps))} %`
        : '';
    return `Training${share}`;
  }
  const broken = job?.state === JobState.FAILED || job?.state === JobState.CANCELLED;
  if (broken && !scene.liveModel) return `Training ${outcomeOf(job)}`;
  if (broken) return `Ready – newest training ${outcomeOf(job)}`;
  return scene.liveModel ? 'Ready' : 'No model yet';
}

/** Refreshed while a training runs. */
export const followMs = 3000;

export function SceneCard({ scene, onDelete }: { scene: Scene; onDelete: () => void }): JSX.Element {
  const { value, ask } = useAsked(
    (signal) => know(scene, signal),
    [scene.liveModel, scene.activeJob],
  );
  useEffect(() => {
    if (!scene.activeJob) return undefined;
    const timer = setInterval(ask, followMs);
    return () => clearInterval(timer);
  }, [scene.activeJob]);
  const title = scene.displayName || lastId(scene.name);
  const to = scene.activeJob ? `/jobs/${lastId(scene.activeJob)}` : `/scenes/${lastId(scene.name)}`;
  const { model } = value ?? {};
  const failed = value?.job?.state === JobState.FAILED;
  const kind = scene.activeJob ? 'busy' : failed ? 'failed' : scene.liveModel ? 'ready' : '';
  const first = value?.view;
  return (
    <article class="scene-card">
      <Link to={to}>
        <div class="preview">
          <ScenePhoto
            scene={scene.name}
            {...(model && { parent: model.name, rendering: first })}
          />
        </div>
        <h2>{title}</h2>
      </Link>
      <p>
        <span class={`state ${kind}`}>{stateOf(scene, value?.job)}</span>
      </p>
      <p class="quiet">
        {model
          ? `${countText(model.numGaussians)} Gaussians, ${bytesText(model.numBytes)}`
          : dateText(scene.createTime)}
      </p>
      <ConfirmButton
        class="bare delete"
        sure="Delete it?"
        label={`Delete ${title}`}
        disabled={scene.activeJob !== ''}
        onConfirm={onDelete}
      >
        <Icon name="trash" />
      </ConfirmButton>
    </article>
  );
}

export function UploadCard({ task }: { task: UploadTask }): JSX.Element {
  const state = useStore(task.state);
  const share = shareOf(state);
  return (
    <article class="scene-card">
      <Link to={`/uploads/${state.record.id}`}>
        <div class="preview">
          <Icon name="upload" />
        </div>
        <h2>{state.record.displayName}</h2>
      </Link>
      <p>
        <span class="state busy">
          {state.phase === 'failed'
            ? 'Upload has stopped'
            : `Uploading – ${Math.round(100 * share)} %`}
        </span>
      </p>
      <progress max={1} value={share} aria-label="Upload" />
    </article>
  );
}
