import { JobEvent_TermSkipped_Term, JobStage, JobState } from '../../gen/pepeseg/v1/job_service_pb';

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
export function outcomeOf({ state, stage }: {
  state: JobState;
  stage: JobStage;
}): string {
  const broken = state === JobState.FAILED || state === JobState.CANCELLED;
  return broken && stage ? `${jobStates[state]} in ${stageName(stage)}` : jobStates[state];
}

/** Returns a stage's name for people; empty before the first, the number of an unknown one. */
export function stageName(stage: JobStage): string {
  if (stage === JobStage.UNSPECIFIED) return '';
  return stages.find(([known]) => known === stage)?.[1] ?? String(stage);
}

/** Returns the name of a skipped part of a stage: "depth". */
export function termName(term: JobEvent_TermSkipped_Term): string {
  return JobEvent_TermSkipped_Term[term]?.toLowerCase() ?? String(term);
}

/** Stages of a job in their order, with their names for people. */
export const stages: readonly (readonly [stage: JobStage, name: string])[] = [
  [JobStage.PREPARE, 'Prepare'],
  [JobStage.SFM, 'Poses'],
  [JobStage.PRIORS, 'Masks and depth'],
  [JobStage.RECONSTRUCT, 'Reconstruct'],
  [JobStage.EVALUATE, 'Score'],
  [JobStage.FEATURES, 'Segment features'],
  [JobStage.INDEX, 'Index'],
];
