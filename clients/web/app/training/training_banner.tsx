// One line over a workbench whose model is still trained.
import type { JSX } from 'preact';
import { JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { Icon } from '../components/icons';
import { lastId } from '../api/clients';
import { Link } from '../router';
import { stageName } from './job_states';
import { jobTimeLeft, stepText } from './time_left';
import type { Training } from './training_watch';

interface Props {
  training: Training;
  /** Whether the finished model is shown. */
  isReady: boolean;
}

function stateText({ job, progress }: Training): string {
  if (job?.state === JobState.SUCCEEDED) return 'The training is done: loading its model …';
  if (job?.state === JobState.QUEUED) return 'The training waits for others to end.';
  if (!progress) return 'Still training.';
  const stage = stageName(progress.stage).toLowerCase();
  return `Still training: stage ${stage}, ${stepText(progress)}, ${jobTimeLeft(progress)}.`;
}

export function TrainingBanner({ training, isReady }: Props): JSX.Element {
  const { job } = training;
  if (isReady) {
    return (
      <p class="note good thin" role="status">
        <Icon name="check" />
        <span>The training is done: this is its model.</span>
      </p>
    );
  }
  return (
    <div class="note thin" role="note" aria-label="The training">
      <span class="training-dot" aria-hidden="true" />
      <p>
        {stateText(training)} <span class="quiet">The model will replace this.</span>
      </p>
      {job && <Link to={`/jobs/${lastId(job.name)}`}>Back to the training</Link>}
    </div>
  );
}
