// The progress of an upload. It continues while other screens are shown, and after a reload.
import type { JSX } from 'preact';
import { useEffect } from 'preact/hooks';
import { ConfirmButton } from '../components/confirm_button';
import { FailureNote } from '../components/failure_note';
import { Header } from '../components/header';
import { bytesText, durationText } from '../format';
import { goTo, Link } from '../router';
import { useStore } from '../store';
import { describe } from '../upload/dataset_summary';
import type { Phase, UploadState, UploadTask } from '../upload/upload_task';
import { dropUpload, uploads, uploadsKnown } from '../upload/uploads';

const phases: Record<Phase, string> = {
  reading: 'Reading the files',
  sending: 'Uploading',
  sealing: 'Checking that all has arrived',
  done: 'Uploaded',
  failed: 'The upload has stopped',
  'given up': 'Cancelled',
};

export function shareOf({ doneBytes, totalBytes }: UploadState): number {
  return totalBytes === 0 ? 0 : Math.min(1, doneBytes / totalBytes);
}

function Progress({ task }: { task: UploadTask }): JSX.Element {
  const state = useStore(task.state);
  const { record, phase, doneBytes, totalBytes, bytesPerSecond, job, failure } = state;
  useEffect(() => {
    if (phase !== 'done') return;
    goTo(job ? `/jobs/${job}` : `/scenes/${record.sceneId}`, true);
    dropUpload(task);
  }, [phase]);
  const giveUp = async () => {
    await task.giveUp();
    dropUpload(task);
    goTo('/', true);
  };
  const left = bytesPerSecond > 0 ? (totalBytes - doneBytes) / bytesPerSecond : undefined;
  return (
    <div class="card narrow" data-phase={phase}>
      <h2>{phases[phase]}</h2>
      <p class="quiet">{describe(record.files)}</p>
      <progress max={1} value={shareOf(state)} aria-label={phases[phase]} />
      <p role="status">
        {bytesText(doneBytes)} of {bytesText(totalBytes)}
        {phase === 'sending' && left !== undefined && `, ${durationText(left)} left`}
      </p>
      {!record.kept && (
        <p class="note bad">
          Keep this page open: the browser has no room for a copy of the files. After a reload drop
          the same files again, and the upload goes on from where it was.
        </p>
      )}
      <FailureNote failure={failure} again={() => void task.run()} />
      <div class="row">
        <ConfirmButton sure="Really cancel?" onConfirm={() => void giveUp()}>
          Cancel
        </ConfirmButton>
      </div>
    </div>
  );
}

export function UploadScreen({ uploadId }: { uploadId: string }): JSX.Element {
  const all = useStore(uploads);
  const known = useStore(uploadsKnown);
  const task = all.find((other) => other.state.get().record.id === uploadId);
  return (
    <div class="screen narrow">
      <Header title={task?.state.get().record.displayName ?? 'Upload'} back="/" />
      <main>
        {task && <Progress task={task} />}
        {!task && known && (
          <p class="card narrow">
            This upload has ended. <Link to="/">To the scenes</Link>
          </p>
        )}
      </main>
    </div>
  );
}
