// A scene without a model: what it has, and what to do next.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import type { Scene } from '../../gen/pepeseg/v1/scene_service_pb';
import { datasets, jobs, lastId, newRequestId } from '../api/clients';
import type { Failure } from '../api/failure';
import { failureOf } from '../api/failure';
import { steadily } from '../api/server_link';
import { useAsked } from '../api/use_asked';
import { Advice } from '../components/advice';
import { FailureNote } from '../components/failure_note';
import { bytesText, dateText } from '../format';
import { goTo, Link } from '../router';
import { outcomeOf } from '../training/job_states';
import { defaultTraining } from '../training/presets';
import { TrainingChoice } from '../training/training_choice';
import { adviceOnDataset } from './mask_advice';

interface Props {
  scene: Scene;
  again: () => void;
}

export function SceneWithoutModel({ scene }: Props): JSX.Element {
  const list = useAsked(
    async (signal) =>
      (await datasets.listDatasets({ parent: scene.name, pageSize: 1000 }, { signal })).datasets,
    [scene.name],
  );
  const past = useAsked(
    async (signal) => (await jobs.listJobs({ scene: scene.name, pageSize: 10 }, { signal })).jobs,
    [scene.name],
  );
  const [training, setTraining] = useState(defaultTraining);
  const [failure, setFailure] = useState<Failure>();
  const dataset = list.value?.at(-1);
  const train = async () => {
    if (!dataset) return;
    setFailure(undefined);
    const request = {
      scene: scene.name,
      dataset: dataset.name,
      options: training,
      requestId: newRequestId(),
    };
    try {
      const job = await steadily(() => jobs.trainScene(request));
      goTo(`/jobs/${lastId(job.name)}`);
    } catch (error) {
      setFailure(failureOf(error));
    }
  };
  return (
    <div class="card narrow">
      {scene.activeJob ? (
        <p>
          It is being trained.{' '}
          <Link to={`/jobs/${lastId(scene.activeJob)}`}>Watch the training</Link>
        </p>
      ) : (
        <p>There is no model of this scene yet.</p>
      )}
      {!scene.activeJob && dataset && (
        <>
          <p class="quiet">
            {String(dataset.numFiles)} files, {bytesText(dataset.numBytes)}, of{' '}
            {dateText(dataset.sealTime)}.
          </p>
          <Advice about={dataset.name} text={adviceOnDataset(dataset)} />
          <TrainingChoice options={training} onOptions={setTraining} />
          <button type="button" class="primary" onClick={() => void train()}>
            Train
          </button>
        </>
      )}
      {list.value && !dataset && (
        <p>
          No photographs were uploaded. <Link to="/new">Upload some</Link>, under the same name.
        </p>
      )}
      <FailureNote failure={failure ?? list.failure} again={list.failure && list.ask} />
      {(past.value?.length ?? 0) > 0 && <h2>Trainings</h2>}
      <ul class="plain">
        {past.value?.map((job) => (
          <li key={job.name}>
            <Link to={`/jobs/${lastId(job.name)}`}>{dateText(job.createTime)}</Link>:{' '}
            {outcomeOf(job)}
            {job.error && `: ${job.error.message}`}
          </li>
        ))}
      </ul>
    </div>
  );
}
