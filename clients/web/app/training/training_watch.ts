// A training as WatchJob reports it, resumed after a lost connection from the last event seen. Of the
// time before a watch begins, the server returns the newest progress only, so this page stores what it
// has seen, with the newest picture, for the page after a reload.
import { useEffect, useState } from 'preact/hooks';
import type { Job, JobEvent, JobEvent_Preview, JobProgress } from '../../gen/pepeseg/v1/job_service_pb';
import { JobStage } from '../../gen/pepeseg/v1/job_service_pb';
import { jobs } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { Backoff } from '../api/server_link';
import { secondsOf } from '../format';
import { hasEnded, termName } from './job_states';

export interface Sample {
  readonly step: number;
  readonly value: number;
}

export interface StageRun {
  readonly state: 'running' | 'done' | 'skipped';
  readonly seconds: number | undefined;
  readonly skipped: string;
}

/** A picture of the scene as it is being trained. */
export interface Shown {
  readonly url: string;
  readonly view: string;
  readonly step: number;
  readonly numSteps: number;
  /** Since the start of the stage. */
  readonly seconds: number | undefined;
}

export interface Training {
  readonly job: Job | undefined;
  readonly progress: JobProgress | undefined;
  readonly stages: ReadonlyMap<JobStage, StageRun>;
  readonly metrics: ReadonlyMap<string, number>;
  /** Curves of the stages RECONSTRUCT and FEATURES. */
  readonly loss: readonly Sample[];
  readonly psnr: readonly Sample[];
  readonly gaussians: readonly Sample[];
  readonly featureLoss: readonly Sample[];
  readonly notes: readonly string[];
  /** Time of the start of the stage RECONSTRUCT, seconds since 1970. */
  readonly begun: number | undefined;
  readonly picture: Shown | undefined;
  readonly sequence: bigint;
}

export const noTraining: Training = {
  job: undefined,
  progress: undefined,
  stages: new Map(),
  metrics: new Map(),
  loss: [],
  psnr: [],
  gaussians: [],
  featureLoss: [],
  notes: [],
  begun: undefined,
  picture: undefined,
  sequence: 0n,
};

/** Adds a point. A step that is repeated from a checkpoint replaces the points from there on. */
function extended(
  samples: readonly Sample[],
  step: number,
  value: number | undefined,
): readonly Sample[] {
  if (value === undefined) return samples;
  const last = samples.at(-1);
  const kept = last && last.step >= step ? samples.filter((sample) => sample.step < step) : samples;
  return [...kept, { step, value }];
}

function progressed(training: Training, progress: JobProgress): Training {
  const step = Number(progress.step);
  const next = { ...training, progress };
  if (progress.stage === JobStage.FEATURES) {
    return { ...next, featureLoss: extended(training.featureLoss, step, progress.loss) };
  }
  if (progress.stage !== JobStage.RECONSTRUCT) return next;
  return {
    ...next,
    loss: extended(training.loss, step, progress.loss),
    psnr: extended(training.psnr, step, progress.psnr),
    gaussians: extended(training.gaussians, step, Number(progress.numGaussians)),
  };
}

function shown(training: Training, preview: JobEvent_Preview, time: JobEvent['time']): Shown {
  const { begun } = training;
  const bytes = Array.from(preview.jpeg, (byte) => String.fromCharCode(byte)).join('');
  return {
    url: `data:image/jpeg;base64,${btoa(bytes)}`,
    view: preview.view,
    step: Number(preview.step),
    numSteps: Number(preview.numSteps),
    seconds: begun === undefined ? undefined : Math.max(0, secondsOf(time) - begun),
  };
}

/** Returns the state after an event. */
export function after(training: Training, { sequence, time, event }: JobEvent): Training {
  const known = {
    ...training,
    sequence: sequence > training.sequence ? sequence : training.sequence,
  };
  const { job } = training;
  switch (event.case) {
    case 'snapshot':
      // The snapshot has the state at the start of the watch; the events that follow lead up to it.
      return { ...training, job: event.value, progress: event.value.progress ?? training.progress };
    case 'stageStarted': {
      const run: StageRun = { state: 'running', seconds: undefined, skipped: '' };
      const stages = new Map(training.stages).set(event.value.stage, run);
      const begun = event.value.stage === JobStage.RECONSTRUCT ? secondsOf(time) : training.begun;
      return { ...known, stages, begun, job: job && { ...job, stage: event.value.stage } };
    }
    case 'stageEnded': {
      const { stage, elapsed, skipped, metrics } = event.value;
      const state = skipped ? 'skipped' : 'done';
      const stages = new Map(training.stages).set(stage, {
        state,
        seconds: secondsOf(elapsed),
        skipped,
      });
      return {
        ...known,
        stages,
        metrics: new Map([...training.metrics, ...Object.entries(metrics)]),
      };
    }
    case 'progress':
      return progressed(known, event.value);
    case 'preview':
      return { ...known, picture: shown(training, event.value, time) };
    case 'warning':
      return { ...known, notes: [...training.notes, event.value.message] };
    case 'termSkipped': {
      const note = `Skipped part “${termName(event.value.term)}”: ${event.value.reason}`;
      return { ...known, notes: [...training.notes, note] };
    }
    case 'stateChanged': {
      const { state, error, model } = event.value;
      return { ...known, job: job && { ...job, state, model, wait: undefined, ...(error && { error }) } };
    }
    default:
      return known;
  }
}

const storeName = (job: string) => `pepeseg-training-${job}`;

function remember(job: string, { sequence, stages, metrics, notes, ...rest }: Training): void {
  const { loss, psnr, gaussians, featureLoss, begun, picture } = rest;
  const maps = { stages: [...stages], metrics: [...metrics] };
  const curves = { loss, psnr, gaussians, featureLoss };
  const kept = { sequence: String(sequence), ...maps, notes, ...curves, begun, picture };
  try {
    sessionStorage.setItem(storeName(job), JSON.stringify(kept));
  } catch {
    // No room: after a reload the page begins with what the server returns.
  }
}

interface Kept {
  sequence: string;
  stages: [JobStage, StageRun][];
  metrics: [string, number][];
}

function recall(job: string): Training {
  try {
    const text = sessionStorage.getItem(storeName(job)) ?? '';
    const { sequence, stages, metrics, ...rest } = JSON.parse(text) as Kept &
      Pick<
        Training,
        'loss' | 'psnr' | 'gaussians' | 'featureLoss' | 'notes' | 'begun' | 'picture'
      >;
    const maps = { stages: new Map(stages), metrics: new Map(metrics) };
    return { ...noTraining, ...rest, ...maps, sequence: BigInt(sequence) };
  } catch {
    return noTraining; // nothing is stored
  }
}

async function watch(
  name: string,
  signal: AbortSignal,
  show: (training: Training) => void,
): Promise<void> {
  const backoff = new Backoff();
  let training = recall(name);
  for (;;) {
    try {
      const options = { name, afterSequence: training.sequence };
      for await (const event of jobs.watchJob(options, { signal })) {
        backoff.reset();
        training = after(training, event);
        show(training);
        const { case: kind } = event.event;
        if (kind === 'progress' || kind === 'preview') remember(name, training);
      }
      return;
    } catch (error) {
      if (signal.aborted || isCancelled(error)) return;
      const failure = failureOf(error);
      if (!failure.away) throw error;
      await backoff.wait(failure.what, failure.retryMs, signal);
      if (signal.aborted) return;
    }
  }
}

export function useTraining(name: string): { training: Training; failure: Failure | undefined } {
  const [training, setTraining] = useState(noTraining);
  const [failure, setFailure] = useState<Failure>();
  useEffect(() => {
    const controller = new AbortController();
    let drawing = 0;
    watch(name, controller.signal, (next) => {
      // An old training sends thousands of events at once: only the newest state is drawn.
      cancelAnimationFrame(drawing);
      drawing = requestAnimationFrame(() => setTraining(next));
    }).catch((error: unknown) => setFailure(failureOf(error)));
    return () => {
      controller.abort();
      cancelAnimationFrame(drawing);
    };
  }, [name]);
  return { training, failure };
}

export function isOver(training: Training): boolean {
  return training.job !== undefined && hasEnded(training.job.state);
}
