// The stages of a training: which are done, and how long each took.
import type { JSX } from 'preact';
import { JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { Icon } from '../components/icons';
import { durationText } from '../format';
import { hasEnded, jobStates, stages } from './job_states';
import type { Training } from './training_watch';

function stageTime(seconds: number): string {
  return seconds < 1 ? '< 1 s' : durationText(seconds);
}

export function StageList({ training }: { training: Training }): JSX.Element {
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
