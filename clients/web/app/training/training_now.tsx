// What a training does now: the time left of all of it first.
import type { ComponentChildren, JSX } from 'preact';
import { JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { bytesText, deviceText } from '../format';
import { stageName } from './job_states';
import { useWait, waitText } from './queue_wait';
import { jobTimeLeft, stageText, stepText } from './time_left';
import type { Training } from './training_watch';

interface Props {
  training: Training;
  children: ComponentChildren;
}

/** `children`: what can be done now. Nothing after the end. */
export function TrainingNow({ training, children }: Props): JSX.Element | null {
  const { job, progress } = training;
  const wait = useWait(job);
  if (job?.state === JobState.QUEUED) {
    return (
      <div class="card now">
        <p class="time-left" role="status">
          {waitText(wait, Date.now() / 1000)}
        </p>
      </div>
    );
  }
  if (job?.state !== JobState.RUNNING) return null;
  const share = Number(progress?.step ?? 0) / Math.max(1, Number(progress?.numSteps ?? 1));
  const stage = progress ? stageText(progress) : stageName(job.stage);
  const facts = [
    progress && progress.stepsPerSecond > 0 && `${progress.stepsPerSecond.toFixed(1)} steps/s`,
    progress && progress.memoryBytes > 0n && `${bytesText(progress.memoryBytes)} of memory`,
    job.device && `on ${deviceText(job.device)}`,
  ].filter(Boolean);
  return (
    <div class="card now">
      <div class="row wrap">
        <p class="time-left">{jobTimeLeft(progress)}</p>
        <span class="spacer" />
        {children}
      </div>
      <p>
        <strong role="status">{stage || 'Starting'}</strong>
        {progress && `: ${stepText(progress)}`}
      </p>
      <progress max={1} value={share} aria-label={`${stage || 'Starting'}: steps done`} />
      {facts.length > 0 && <p class="quiet">{facts.join(', ')}</p>}
    </div>
  );
}
