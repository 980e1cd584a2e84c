// The wait of a queued job. A watch says it once, at its start, so it is asked for again while the job is queued.
import { useEffect, useState } from 'preact/hooks';
import type { Job, Job_Wait } from '../../gen/pepeseg/v1/job_service_pb';
import { JobState, Job_Wait_Reason } from '../../gen/pepeseg/v1/job_service_pb';
import { jobs } from '../api/clients';
import { steadily } from '../api/server_link';
import { durationText, secondsOf } from '../format';

/** Time between two requests, milliseconds. */
const pauseMs = 5000;

/** Returns what a job waits for. `now`: seconds since 1970. */
export function waitText(wait: Job_Wait | undefined, now: number): string {
  switch (wait?.reason) {
    case Job_Wait_Reason.DEVICE: {
      const { jobsAhead } = wait;
      if (jobsAhead === 0) return 'Next, when a device is free';
      const others = `${jobsAhead} ${jobsAhead === 1 ? 'other' : 'others'}`;
      return `After ${others}, when a device is free`;
    }
    case Job_Wait_Reason.QUOTA:
      return 'Waiting until another training of the project ends, by its quota';
    case Job_Wait_Reason.RETRY:
      return `${durationText(secondsOf(wait.retryTime) - now)} until the next attempt`;
    default: // not known, or a newer server's reason
      return 'Waiting for other trainings to end';
  }
}

/** Asks what a job waits for, until it is no longer queued. */
export async function followWait(
  name: string,
  signal: AbortSignal,
  take: (wait: Job_Wait | undefined) => void,
  pause = pauseMs,
): Promise<void> {
  for (;;) {
    await new Promise((wake) => setTimeout(wake, pause));
    if (signal.aborted) return;
    const { state, wait } = await steadily(() => jobs.getJob({ name }, { signal }), signal);
    if (signal.aborted || state !== JobState.QUEUED) return;
    take(wait);
  }
}

/** Returns what a job waits for while it is queued. */
export function useWait(job: Job | undefined): Job_Wait | undefined {
  const [newest, setNewest] = useState<Job_Wait>();
  const isQueued = job?.state === JobState.QUEUED;
  const name = job?.name ?? '';
  useEffect(() => {
    setNewest(undefined);
    if (!isQueued) return undefined;
    const controller = new AbortController();
    // A failure shows at the watch.
    followWait(name, controller.signal, setNewest).catch(() => undefined);
    return () => controller.abort();
  }, [name, isQueued]);
  return newest ?? job?.wait;
}
