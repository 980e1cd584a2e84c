// What the dropped files are, what is wrong with them, and advice.
import type { JSX } from 'preact';
import { FileKind } from '../../gen/pepeseg/v1/dataset_service_pb';
import { Icon } from '../components/icons';
import { bytesText } from '../format';
import type { Dataset } from '../upload/dataset_files';
import { describe } from '../upload/dataset_summary';
import type { Verdict } from '../upload/dataset_verdict';

interface Props {
  dataset: Dataset;
  verdict: Verdict;
  /** Sentences that prevent nothing; undefined while the photographs are looked at. */
  advice: readonly string[] | undefined;
}

const noteIcons = { good: 'check', mixed: 'help', bad: 'warn' } as const;

export function DatasetNote({ dataset, verdict, advice }: Props): JSX.Element {
  const { files, leftOut } = dataset;
  const { canUpload, canTrain, faults } = verdict;
  const tone = verdict.tone === 'good' && advice?.length ? 'mixed' : verdict.tone;
  const bytes = files.reduce((sum, { file }) => sum + file.size, 0);
  const hasPoses = files.some(({ kind }) => kind === FileKind.POSES);
  return (
    <div class={`note ${tone}`} role="status">
      <Icon name={noteIcons[tone]} />
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
        {advice === undefined && <p class="quiet late">Looking at the photographs …</p>}
        {advice?.map((sentence) => (
          <p key={sentence}>{sentence}</p>
        ))}
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
