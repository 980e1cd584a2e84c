// A training: time left, what it does, its picture, stages and curves. Clicks and cancelling.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { jobs, scenes, sceneIdOf } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import { useAsked } from '../api/use_asked';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import { Icon } from '../components/icons';
import { Link } from '../router';
import { hasEnded, jobStates } from '../training/job_states';
import { useAnswersClicks } from '../training/snapshot_probe';
import { StageList } from '../training/stage_list';
import { TrainingCurves } from '../training/training_curves';
import { TrainingNow } from '../training/training_now';
import { TrainingOutcome } from '../training/training_outcome';
import { TrainingPicture } from '../training/training_picture';
import { useTraining } from '../training/training_watch';

/** Returns the scene's name as people gave it; its id while that is not known. */
export function useSceneName(scene: string | undefined): string {
  const { value } = useAsked(
    async (signal) => scene && (await scenes.getScene({ name: scene }, { signal })).displayName,
    [scene],
  );
  return value || sceneIdOf(scene ?? '');
}

export function TrainingScreen({ jobId }: { jobId: string }): JSX.Element {
  const name = `jobs/${jobId}`;
  const { training, failure } = useTraining(name);
  const answersClicks = useAnswersClicks(name, training);
  const [refused, setRefused] = useState<Failure>();
  const { job, notes } = training;
  const sceneName = useSceneName(job?.scene);
  const cancel = async () => {
    setRefused(undefined);
    try {
      await steadily(() => jobs.cancelJob({ name }));
    } catch (error) {
      setRefused(failureOf(error));
    }
  };
  const running = job && !hasEnded(job.state);
  return (
    <div class="screen" data-state={job ? jobStates[job.state] : ''}>
      <Header title={sceneName ? `Training ${sceneName}` : 'Training'} back="/">
        {running && (
          <ConfirmButton sure="Really cancel?" onConfirm={() => void cancel()}>
            Cancel
          </ConfirmButton>
        )}
      </Header>
      <main>
        <FailureNote failure={failure ?? refused} />
        {!job && !failure && (
          <p class="loading" role="status">
            Asking for the training …
          </p>
        )}
        <TrainingOutcome training={training} />
        <TrainingNow training={training}>
          {answersClicks && (
            <Link to={`/jobs/${jobId}/clicks`} class="button primary">
              <Icon name="plus" />
              Try clicks now
            </Link>
          )}
        </TrainingNow>
        {job && (
          <div class="training">
            <TrainingPicture training={training} />
            <div class="card">
              <StageList training={training} />
            </div>
          </div>
        )}
        {job && (
          <div class="card">
            <TrainingCurves training={training} />
          </div>
        )}
        {notes.length > 0 && (
          <section class="card" aria-labelledby="notes-title">
            <h2 id="notes-title">Notes</h2>
            <ul class="notes">
              {notes.map((note, i) => (
                <li key={i}>{note}</li>
              ))}
            </ul>
          </section>
        )}
      </main>
    </div>
  );
}
