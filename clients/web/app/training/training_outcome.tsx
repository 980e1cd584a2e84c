// How a training ended, and what to do next.
import type { JSX } from 'preact';
import { JobStage, JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { sceneIdOf } from '../api/clients';
import { Icon } from '../components/icons';
import { Link } from '../router';
import { hasEnded, stageName } from './job_states';
import type { Training } from './training_watch';

export function TrainingOutcome({ training }: { training: Training }): JSX.Element | null {
  const { job, metrics } = training;
  if (!job || !hasEnded(job.state)) return null;
  const sceneId = sceneIdOf(job.scene);
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
