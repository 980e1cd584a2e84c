import { JobState } from '../../gen/pepeseg/v1/job_service_pb';

export const jobStates: Record<JobState, string> = {
  [JobState.UNSPECIFIED]: '',
  [JobState.QUEUED]: 'waiting',
  [JobState.RUNNING]: 'training',
  [JobState.SUCCEEDED]: 'done',
  [JobState.FAILED]: 'failed',
  [JobState.CANCELLED]: 'cancelled',
};

export function hasEnded(state: JobState): boolean {
  return state === JobState.SUCCEEDED || state === JobState.FAILED || state === JobState.CANCELLED;
}

/** Of a job, in the order in which they run, for people. */
export const stages: readonly (readonly [stage: string, name: string])[] = [
  ['prepare', 'Prepare'],
  ['sfm', 'Poses'],
  ['priors', 'Masks and depth'],
  ['reconstruct', 'Reconstruct'],
  ['evaluate', 'Score'],
  ['features', 'Segment features'],
  ['index', 'Index'],
];
