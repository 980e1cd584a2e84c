// A new scene: name, photographs, and the training's preset.
import { toJsonString } from '@bufbuild/protobuf';
import type { JSX } from 'preact';
import { useRef, useState } from 'preact/hooks';
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
import { TrainingOptionsSchema } from '../../gen/pepeseg/v1/training_options_pb';
import { Header } from '../components/header';
import { Icon } from '../components/icons';
import { bytesText } from '../format';
import { goTo } from '../router';
import { defaultTraining } from '../training/presets';
import { TrainingChoice } from '../training/training_choice';
import type { Dataset, DroppedFile } from '../upload/dataset_files';
import { readDataset } from '../upload/dataset_files';
import { describe } from '../upload/dataset_summary';
import type { Verdict } from '../upload/dataset_verdict';
import { verdictOf } from '../upload/dataset_verdict';
import { filesOfDrop, filesOfInput } from '../upload/dropped_files';
import { sceneIdFrom } from '../upload/scene_id';
import { beginUpload } from '../upload/uploads';

function DropZone({ onFiles }: { onFiles: (files: DroppedFile[]) => void }): JSX.Element {
  const [over, setOver] = useState(false);
  const files = useRef<HTMLInputElement>(null);
  const folder = useRef<HTMLInputElement>(null);
  const drop = async (event: DragEvent) => {
    event.preventDefault();
    setOver(false);
    if (event.dataTransfer) onFiles(await filesOfDrop(event.dataTransfer));
  };
  const picked = (event: Event) => onFiles(filesOfInput(event.currentTarget as HTMLInputElement));
  return (
    <div
      class={`drop ${over ? 'over' : ''}`}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => setOver(false)}
      onDrop={(event) => void drop(event)}
    >
      <Icon name="upload" />
      <p>
        <strong>Drop photographs, a folder or a video here</strong>
      </p>
      <p class="quiet">
        Twenty or more photographs of the same things from all around. A folder may also bring
        poses, masks and depth.
      </p>
      <div class="row center">
        <button type="button" onClick={() => files.current?.click()}>
          Choose files
        </button>
        <button type="button" onClick={() => folder.current?.click()}>
          Choose a folder
        </button>
      </div>
      <input
        ref={files}
        id="files"
        type="file"
        multiple
        hidden
        aria-label="Files"
        onChange={picked}
      />
      <input
        ref={folder}
        id="folder"
        type="file"
        hidden
        aria-label="Folder"
        {...{ webkitdirectory: true }}
        onChange={picked}
      />
    </div>
  );
}

function Summary({ dataset, verdict }: { dataset: Dataset; verdict: Verdict }): JSX.Element {
  const { files, leftOut } = dataset;
  const { tone, canUpload, canTrain, faults } = verdict;
  const bytes = files.reduce((sum, { file }) => sum + file.size, 0);
  const hasPoses = files.some(({ kind }) => kind === FileKind.POSES);
  return (
    <div class={`note ${tone}`} role="status">
      <Icon name={tone === 'good' ? 'check' : 'warn'} />
      <div>
        {files.length > 0 && (
          <strong>
            {describe(files)}: {bytesText(bytes)}
          </strong>
        )}
        {faults.map((fault) => (
          <p key={fault}>{fault}</p>
        ))}
        {!canUpload && (
          <p>Photographs are .jpg, .png, .webp or .heic; videos .mp4, .mov, .webm, .mkv or .avi.</p>
        )}
        {canTrain && !hasPoses && (
          <p>Without poses: the training first estimates where each photograph was taken.</p>
        )}
        {leftOut.length > 0 && (
          <details>
            <summary>
              {leftOut.length === 1 ? '1 file is' : `${leftOut.length} files are`} left out
            </summary>
            <p class="quiet">{leftOut.slice(0, 50).join(', ')}</p>
          </details>
        )}
      </div>
    </div>
  );
}

function nameOf(dropped: readonly DroppedFile[]): string {
  const first = dropped[0]?.path ?? '';
  if (first.includes('/')) return first.split('/')[0] ?? '';
  return dropped.length === 1 ? first.replace(/\.\w+$/, '') : '';
}

export function NewSceneScreen(): JSX.Element {
  const [name, setName] = useState('');
  const [dataset, setDataset] = useState<Dataset>();
  const [training, setTraining] = useState(defaultTraining);
  const [trains, setTrains] = useState(true);
  const [busy, setBusy] = useState(false);
  const newest = useRef<readonly DroppedFile[]>([]);
  const take = async (dropped: DroppedFile[]) => {
    if (dropped.length === 0) return;
    newest.current = dropped;
    if (name === '') setName(nameOf(dropped));
    const read = await readDataset(dropped);
    if (newest.current === dropped) setDataset(read);
  };
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
          {dataset && verdict && <Summary dataset={dataset} verdict={verdict} />}
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
