// A training: stages, curves, time left, cancel.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { JobStage, JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { jobs, pictureUrl, sceneIdOf, scenes } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import { useAsked } from '../api/use_asked';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import { Icon } from '../components/icons';
import { ScenePhoto } from '../components/photo';
import { bytesText, deviceText, durationText, secondsOf } from '../format';
import { Link } from '../router';
import { Curve } from '../training/curve';
import { hasEnded, jobStates, stageName, stages } from '../training/job_states';
import type { Shown, Training } from '../training/training_watch';
import { useTraining } from '../training/training_watch';

function stageTime(seconds: number): string {
  return seconds < 1 ? '< 1 s' : durationText(seconds);
}

function Stages({ training }: { training: Training }): JSX.Element {
  const { stages: runs, job } = training;
  return (
    <ol class="stages" aria-label="Stages">
      {stages.map(([stage, name]) => {
        const run = runs.get(stage);
        const ended = job && hasEnded(job.state) && job.state !== JobState.SUCCEEDED;
        const broken = ended && job.stage === stage;
        const state = broken ? 'broken' : (run?.state ?? 'waiting');
        return (
          <li
            key={stage}
            class={state}
            aria-current={job?.stage === stage && state === 'running' ? 'step' : undefined}
          >
            <span class="dot">
              {state === 'done' && <Icon name="check" />}
              {state === 'skipped' && <Icon name="minus" />}
              {state === 'broken' && <Icon name="close" />}
            </span>
            <span>{name}</span>
            <span class="quiet" title={run?.skipped}>
              {state === 'skipped' && 'not needed'}
              {state === 'done' && run?.seconds !== undefined && stageTime(run.seconds)}
              {state === 'running' && 'running'}
              {broken && jobStates[job.state]}
            </span>
          </li>
        );
      })}
    </ol>
  );
}

function Now({ training }: { training: Training }): JSX.Element | null {
  const { job, progress } = training;
  if (!job || !progress || hasEnded(job.state)) return null;
  const share = Number(progress.step) / Math.max(1, Number(progress.numSteps));
  const name = stageName(progress.stage);
  return (
    <div class="now">
      <progress max={1} value={share} aria-label={`${name}: steps done`} />
      <p role="status">
        {name}: step {Number(progress.step).toLocaleString('en')} of{' '}
        {Number(progress.numSteps).toLocaleString('en')}
        {progress.eta && `, about ${durationText(secondsOf(progress.eta))} left`}
      </p>
      <p class="quiet">
        {[
          progress.stepsPerSecond > 0 && `${progress.stepsPerSecond.toFixed(1)} steps/s`,
          progress.memoryBytes > 0n && `${bytesText(progress.memoryBytes)} of memory`,
          job.device && `on ${deviceText(job.device)}`,
        ]
          .filter(Boolean)
          .join(', ')}
      </p>
    </div>
  );
}

/** The newest picture of the scene as it is being trained. */
function Picture({ picture }: { picture: Shown }): JSX.Element {
  const step = `step ${picture.step.toLocaleString('en')} of ${picture.numSteps.toLocaleString('en')}`;
  return (
    <figure class="training-picture">
      <img src={picture.url} alt={`${picture.view} as it is being trained: ${step}`} />
      <figcaption>
        {step}
        {picture.seconds !== undefined && `, after ${durationText(picture.seconds)}`}
      </figcaption>
    </figure>
  );
}

/** The scene in a picture: of its model, of the training, or its first photograph. */
function ScenePicture({ training }: { training: Training }): JSX.Element | null {
  const { job, picture } = training;
  const preview = usePreview(job?.model);
  if (!job) return null;
  return (
    <div class="preview">
      {preview && <img src={preview} alt="" />}
      {!preview && picture && <Picture picture={picture} />}
      {!preview && !picture && <ScenePhoto scene={job.scene} parent={job.dataset} />}
    </div>
  );
}

function Outcome({
  training,
  sceneId,
}: {
  training: Training;
  sceneId: string;
}): JSX.Element | null {
  const { job, metrics } = training;
  if (!job || !hasEnded(job.state)) return null;
  if (job.state === JobState.SUCCEEDED) {
    const psnr = metrics.get('psnr');
    const ssim = metrics.get('ssim');
    const maskQuality = metrics.get('mask_quality');
    return (
      <div class="note good" role="status">
        <Icon name="check" />
        <div>
          <strong>The scene is ready.</strong>
          {psnr !== undefined && (
            <p>
              Held-out views: PSNR {psnr.toFixed(2)} dB
              {ssim !== undefined && `, SSIM ${ssim.toFixed(3)}`}
            </p>
          )}
          {maskQuality !== undefined && (
            <p>
              Mask quality {maskQuality.toFixed(2)}: how far the masks of different views agree,
              from 0 to 1. Under 0.5 segments may be poor.
            </p>
          )}
        </div>
        <Link to={`/scenes/${sceneId}`} class="button primary">
          Open the scene
        </Link>
      </div>
    );
  }
  const failed = job.state === JobState.FAILED;
  return (
    <div class={`note ${failed ? 'bad' : ''}`} role="status">
      <Icon name="warn" />
      <div>
        <strong>
          The training {failed ? 'failed' : 'was cancelled'}
          {job.stage !== JobStage.UNSPECIFIED && ` in the stage “${stageName(job.stage)}”`}.
        </strong>
        {failed && job.error?.message && <p>{job.error.message}</p>}
        <p>
          The photographs are still there: <Link to={`/scenes/${sceneId}`}>train again</Link>, with
          other options or as before.
        </p>
      </div>
    </div>
  );
}

function Curves({ training }: { training: Training }): JSX.Element {
  const { job, loss, psnr, gaussians, featureLoss } = training;
  const steps = job?.effectiveOptions?.reconstruct?.numSteps ?? 0;
  const featureSteps = job?.effectiveOptions?.features?.numSteps ?? 0;
  return (
    <div class="curves">
      <Curve title="Loss" samples={loss} numSteps={steps} digits={4} />
      <Curve title="PSNR of training views" unit="dB" samples={psnr} numSteps={steps} />
      <Curve title="Gaussians" samples={gaussians} numSteps={steps} digits={0} />
      <Curve title="Loss of features" samples={featureLoss} numSteps={featureSteps} digits={4} />
    </div>
  );
}

/** Returns the scene's name as people gave it; its id while that is not known. */
function useSceneName(scene: string | undefined): string {
  const { value } = useAsked(
    async (signal) => scene && (await scenes.getScene({ name: scene }, { signal })).displayName,
    [scene],
  );
  return value || sceneIdOf(scene ?? '');
}

/** Returns the URL of the new model's rendering of its first view; undefined while there is none. */
function usePreview(model: string | undefined): string | undefined {
  const { value } = useAsked(
    async (signal) => {
      if (!model) return undefined;
      const { views } = await scenes.listViews({ parent: model, pageSize: 1 }, { signal });
      return views[0] && pictureUrl(model, views[0].view, 640);
    },
    [model],
  );
  return value;
}

export function TrainingScreen({ jobId }: { jobId: string }): JSX.Element {
  const name = `jobs/${jobId}`;
  const { training, failure } = useTraining(name);
  const [refused, setRefused] = useState<Failure>();
  const { job, notes } = training;
  const sceneId = sceneIdOf(job?.scene ?? '');
  const sceneName = useSceneName(job?.scene);
  const cancel = async () => {
    setRefused(undefined);
    try {
      await steadily(() => jobs.cancelJob({ name }));
    } catch (error) {
      setRefused(failureOf(error));
    }
  };
  const running = job && !hasEnded(job.state);
  return (
    <div class="screen" data-state={job ? jobStates[job.state] : ''}>
      <Header title={sceneName ? `Training ${sceneName}` : 'Training'} back="/">
        {running && (
          <ConfirmButton sure="Really cancel?" onConfirm={() => void cancel()}>
            Cancel
          </ConfirmButton>
        )}
      </Header>
      <main>
        <FailureNote failure={failure ?? refused} />
        {!job && !failure && (
          <p class="loading" role="status">
            Asking for the training …
          </p>
        )}
        {job?.state === JobState.QUEUED && (
          <p class="note" role="status">
            It waits for other trainings to end.
          </p>
        )}
        {job && <Outcome training={training} sceneId={sceneId} />}
        {job && (
          <div class="training">
            <div class="card">
              <ScenePicture training={training} />
              <Stages training={training} />
            </div>
            <div class="card">
              <Now training={training} />
              <Curves training={training} />
            </div>
          </div>
        )}
        {notes.length > 0 && (
          <section class="card" aria-labelledby="notes-title">
            <h2 id="notes-title">Notes</h2>
            <ul class="notes">
              {notes.map((note, i) => (
                <li key={i}>{note}</li>
              ))}
            </ul>
          </section>
        )}
      </main>
    </div>
  );
}
