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

/** Returns how a job ended, with its stage if it did not succeed: "failed in Poses". */
export function outcomeOf({ state, stage }: { state: JobState; stage: string }): string {
  const broken = state === JobState.FAILED || state === JobState.CANCELLED;
  return broken && stage ? `${jobStates[state]} in ${stageName(stage)}` : jobStates[state];
}

/** Returns a stage's name for people. */
export function stageName(stage: string): string {
  return stages.find(([id]) => id === stage)?.[1] ?? stage;
}

/** Stages of a job in their order, with their names for people. */
export const stages: readonly (readonly [stage: string, name: string])[] = [
  ['prepare', 'Prepare'],
  ['sfm', 'Poses'],
  ['priors', 'Masks and depth'],
  ['reconstruct', 'Reconstruct'],
  ['evaluate', 'Score'],
  ['features', 'Segment features'],
  ['index', 'Index'],
];
