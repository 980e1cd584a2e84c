// A new scene: name, photographs, and the training's preset.
import { toJsonString } from '@bufbuild/protobuf';
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { TrainingOptionsSchema } from '../../gen/pepeseg/v1/training_options_pb';
import { DropZone } from '../components/drop_zone';
import { Header } from '../components/header';
import { goTo } from '../router';
import { defaultTraining } from '../training/presets';
import { TrainingChoice } from '../training/training_choice';
import type { Dataset, DroppedFile } from '../upload/dataset_files';
import { readDataset } from '../upload/dataset_files';
import { verdictOf } from '../upload/dataset_verdict';
import { Digester } from '../upload/digest';
import { takeDropped } from '../upload/dropped_later';
import { adviceOn } from '../upload/photograph_advice';
import { sceneIdFrom } from '../upload/scene_id';
import { beginUpload } from '../upload/uploads';
import { DatasetNote } from './dataset_note';

function nameOf(dropped: readonly DroppedFile[]): string {
  const first = dropped[0]?.path ?? '';
  if (first.includes('/')) return first.split('/')[0] ?? '';
  return dropped.length === 1 ? first.replace(/\.\w+$/, '') : '';
}

/** Returns advice on the photographs; undefined while they are looked at. */
function useAdvice(dataset: Dataset | undefined): readonly string[] | undefined {
  const [advice, setAdvice] = useState<readonly string[]>();
  useEffect(() => {
    setAdvice(undefined);
    if (!dataset) return undefined;
    const digester = new Digester();
    let outdated = false;
    adviceOn(dataset.files, (file) => digester.sha256(file)).then(
      (sentences) => !outdated && setAdvice(sentences),
      // A file that cannot be read is named by the upload.
      () => !outdated && setAdvice([]),
    );
    return () => {
      outdated = true;
      digester.end();
    };
  }, [dataset]);
  return advice;
}

export function NewSceneScreen(): JSX.Element {
  const [name, setName] = useState('');
  const [dataset, setDataset] = useState<Dataset>();
  const [training, setTraining] = useState(defaultTraining);
  const [trains, setTrains] = useState(true);
  const [busy, setBusy] = useState(false);
  const newest = useRef<readonly DroppedFile[]>([]);
  const advice = useAdvice(dataset);
  const take = async (dropped: readonly DroppedFile[]) => {
    if (dropped.length === 0) return;
    newest.current = dropped;
    if (name === '') setName(nameOf(dropped));
    const read = await readDataset(dropped);
    if (newest.current === dropped) setDataset(read);
  };
  useEffect(() => void take(takeDropped()), []);
  const verdict = dataset && verdictOf(dataset);
  const ready = trains ? verdict?.canTrain : verdict?.canUpload;
  const submit = async (event: Event) => {
    event.preventDefault();
    if (!dataset || !ready || name.trim() === '') return;
    setBusy(true);
    const task = await beginUpload({
      sceneId: sceneIdFrom(name),
      displayName: name.trim(),
      files: dataset.files,
      training: trains ? toJsonString(TrainingOptionsSchema, training) : undefined,
    });
    goTo(`/uploads/${task.state.get().record.id}`);
  };
  return (
    <div class="screen narrow">
      <Header title="New scene" back="/" />
      <main>
        <form class="card narrow" onSubmit={(event) => void submit(event)}>
          <DropZone onFiles={(dropped) => void take(dropped)} />
          {dataset && verdict && <DatasetNote dataset={dataset} verdict={verdict} advice={advice} />}
          <label class="field">
            <span>Name</span>
            <input
              type="text"
              maxLength={100}
              required
              value={name}
              placeholder="Kitchen shelf"
              onInput={(event) => setName(event.currentTarget.value)}
            />
          </label>
          <TrainingChoice options={training} onOptions={setTraining} />
          <label class="check">
            <input
              type="checkbox"
              checked={trains}
              onChange={(event) => setTrains(event.currentTarget.checked)}
            />
            Train when everything is uploaded
          </label>
          <button type="submit" class="primary" disabled={!ready || name.trim() === '' || busy}>
            {busy ? 'Reading …' : trains ? 'Upload and train' : 'Upload'}
          </button>
        </form>
      </main>
    </div>
  );
}
