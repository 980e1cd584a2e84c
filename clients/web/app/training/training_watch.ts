// A training as it is told by WatchJob: after a cut from the last event seen. Of what was before a
// watch begins the server tells the newest progress only, so that what this page has seen is kept for
// the page that follows a reload.
import { useEffect, useState } from 'preact/hooks';
import type { Job, JobEvent, JobProgress } from '../../gen/pepeseg/v1/job_service_pb';
import { jobs } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf, isCancelled } from '../api/failure';
import { Backoff } from '../api/server_link';
import { secondsOf } from '../format';
import { hasEnded } from './job_states';

export interface Sample {
  readonly step: number;
  readonly value: number;
}

export interface StageRun {
  readonly state: 'running' | 'done' | 'skipped';
  readonly seconds: number | undefined;
  readonly skipped: string;
}

export interface Training {
  readonly job: Job | undefined;
  readonly progress: JobProgress | undefined;
  readonly stages: ReadonlyMap<string, StageRun>;
  readonly metrics: ReadonlyMap<string, number>;
  /** Of "reconstruct" and of "features". */
  readonly loss: readonly Sample[];
  readonly psnr: readonly Sample[];
  readonly gaussians: readonly Sample[];
  readonly featureLoss: readonly Sample[];
  readonly notes: readonly string[];
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
  sequence: 0n,
};

/** A step that comes again, after a restart from a checkpoint, takes the place of what followed. */
function extended(samples: readonly Sample[], step: number, value: number | undefined): readonly Sample[] {
  if (value === undefined) return samples;
  const last = samples.at(-1);
  const kept = last && last.step >= step ? samples.filter((sample) => sample.step < step) : samples;
  return [...kept, { step, value }];
}

function progressed(training: Training, progress: JobProgress): Training {
  const step = Number(progress.step);
  const next = { ...training, progress };
  if (progress.stage === 'features') {
    return { ...next, featureLoss: extended(training.featureLoss, step, progress.loss) };
  }
  if (progress.stage !== 'reconstruct') return next;
  return {
    ...next,
    loss: extended(training.loss, step, progress.loss),
    psnr: extended(training.psnr, step, progress.psnr),
    gaussians: extended(training.gaussians, step, Number(progress.numGaussians)),
  };
}

/** What is known after an event. */
export function after(training: Training, { sequence, event }: JobEvent): Training {
  const known = { ...training, sequence: sequence > training.sequence ? sequence : training.sequence };
  const { job } = training;
  switch (event.case) {
    case 'snapshot':
      // It tells the state at the start of the watch, and the events that follow how it came there.
      return { ...training, job: event.value };
    case 'stageStarted': {
      const run: StageRun = { state: 'running', seconds: undefined, skipped: '' };
      const stages = new Map(training.stages).set(event.value.stage, run);
      return { ...known, stages, job: job && { ...job, stage: event.value.stage } };
    }
    case 'stageEnded': {
      const { stage, elapsed, skipped, metrics } = event.value;
      const state = skipped ? 'skipped' : 'done';
      const stages = new Map(training.stages).set(stage, { state, seconds: secondsOf(elapsed), skipped });
      return { ...known, stages, metrics: new Map([...training.metrics, ...Object.entries(metrics)]) };
    }
    case 'progress':
      return progressed(known, event.value);
    case 'warning':
      return { ...known, notes: [...training.notes, event.value.message] };
    case 'termSkipped':
      return { ...known, notes: [...training.notes, `${event.value.term}: ${event.value.reason}`] };
    case 'stateChanged': {
      const { state, error, model } = event.value;
      return { ...known, job: job && { ...job, state, model, ...(error && { error }) } };
    }
    default:
      return known;
  }
}

const storeName = (job: string) => `pepeseg-training-${job}`;

function remember(job: string, { sequence, stages, metrics, notes, ...rest }: Training): void {
  const { loss, psnr, gaussians, featureLoss } = rest;
  const maps = { stages: [...stages], metrics: [...metrics] };
  const kept = { sequence: String(sequence), ...maps, notes, loss, psnr, gaussians, featureLoss };
  try {
    sessionStorage.setItem(storeName(job), JSON.stringify(kept));
  } catch {
    // No room: then a reload begins with what the server tells.
  }
}

interface Kept {
  sequence: string;
  stages: [string, StageRun][];
  metrics: [string, number][];
}

function recall(job: string): Training {
  try {
    const text = sessionStorage.getItem(storeName(job)) ?? '';
    const { sequence, stages, metrics, ...rest } = JSON.parse(text) as Kept & Pick<Training, 'loss' | 'psnr' | 'gaussians' | 'featureLoss' | 'notes'>;
    const maps = { stages: new Map(stages), metrics: new Map(metrics) };
    return { ...noTraining, ...rest, ...maps, sequence: BigInt(sequence) };
  } catch {
    return noTraining; // there is nothing kept
  }
}

async function watch(name: string, signal: AbortSignal, show: (training: Training) => void): Promise<void> {
  const backoff = new Backoff();
  let training = recall(name);
  for (;;) {
    try {
      const options = { name, afterSequence: training.sequence };
      for await (const event of jobs.watchJob(options, { signal })) {
        backoff.reset();
        training = after(training, event);
        show(training);
        if (event.event.case === 'progress') remember(name, training);
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
      // An old training's events come by the thousand: the newest is drawn.
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
