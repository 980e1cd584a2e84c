// Finds out when a job that trains answers clicks.
import { useEffect, useMemo, useState } from 'preact/hooks';
import { JobStage, JobState } from '../../gen/pepeseg/v1/job_service_pb';
import { scenes } from '../api/clients';
import type { Training } from './training_watch';

/** Least time between two requests, milliseconds. */
const pauseMs = 2000;

/** Asks once in a while whether a job has a state that answers, until it has one. */
export class SnapshotProbe {
  private askedAt = -Infinity;
  private isAsking = false;
  private isEnded = false;

  /** `ask`: throws while the job has no state. `found`: called once. */
  constructor(
    private readonly ask: () => Promise<unknown>,
    private readonly found: () => void,
  ) {}

  /** Something happened in the job. `now`: milliseconds. */
  async look(now: number): Promise<void> {
    if (this.isEnded || this.isAsking || now - this.askedAt < pauseMs) return;
    this.askedAt = now;
    this.isAsking = true;
    try {
      await this.ask();
      if (!this.isEnded) this.found();
      this.isEnded = true;
    } catch {
      // There is none yet, or the server is away: the next event asks again.
    }
    this.isAsking = false;
  }

  end(): void {
    this.isEnded = true;
  }
}

/** Returns whether the job can have a state that answers: it trains Gaussians, or is further on. */
export function mayAnswer({ job }: Training): boolean {
  return job?.state === JobState.RUNNING && job.stage >= JobStage.RECONSTRUCT;
}

/** Returns whether the job answers clicks. It is asked at its events, while the page is visible. */
export function useAnswersClicks(name: string, training: Training): boolean {
  const [answers, setAnswers] = useState(false);
  const probe = useMemo(
    () =>
      new SnapshotProbe(
        () => scenes.listViews({ parent: name, pageSize: 1 }),
        () => setAnswers(true),
      ),
    [name],
  );
  useEffect(() => () => probe.end(), [probe]);
  const isOpen = mayAnswer(training);
  useEffect(() => {
    if (isOpen && document.visibilityState === 'visible') void probe.look(performance.now());
  }, [probe, isOpen, training.sequence]);
  return answers && isOpen;
}
