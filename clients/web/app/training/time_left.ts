// The progress of a job in words.
import type { JobProgress } from '../../gen/pepeseg/v1/job_service_pb';
import { countText, secondsOf } from '../format';
import { stageName } from './job_states';

/** Returns a time as a person would say it: "about 40 s left". */
export function timeLeftText(seconds: number): string {
  if (seconds < 7.5) return 'a few seconds left';
  if (seconds < 90) return `about ${5 * Math.round(seconds / 5)} s left`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 60) return `about ${minutes} min left`;
  const tens = 10 * Math.round(seconds / 600);
  const rest = tens % 60;
  return `about ${Math.floor(tens / 60)} h${rest > 0 ? ` ${rest} min` : ''} left`;
}

/** Returns the time left of the whole job. */
export function jobTimeLeft(progress: JobProgress | undefined): string {
  if (!progress?.jobEta) return 'time left not known yet';
  return timeLeftText(secondsOf(progress.jobEta));
}

/** Returns what a stage counts: "step 1,500 of 10,000", "matching 19 of 60 pairs". */
export function stepText({ activity, unit, step, numSteps }: JobProgress): string {
  const counted = `${countText(step)} of ${countText(numSteps)}`;
  return activity ? `${activity} ${counted} ${unit}`.trim() : `step ${counted}`;
}

/** Returns the stage with its number, if that is known: "Reconstruct, stage 2 of 5". */
export function stageText({ stage, stageNumber, numStages }: JobProgress): string {
  const number = stageNumber > 0 ? `, stage ${stageNumber} of ${numStages}` : '';
  return `${stageName(stage)}${number}`;
}
