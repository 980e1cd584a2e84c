// Exports the masks of all named things, or of all segments of a level, for an annotation tool.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { AnnotationFormat } from '../../gen/pepeseg/v1/label_service_pb';
import type { AnnotationsRequest } from '../api/fetch_annotations';
import { fetchAnnotations } from '../api/fetch_annotations';
import { saveBlob } from '../mask/save_files';
import { useStore } from '../store';
import type { SceneEverything } from './everything';
import type { SceneLabels } from './labels';
import type { RunningTask } from './running_task';
import type { Level } from './segments';
import { levelNames } from './segments';

interface Format {
  /** Ends the file's name. */
  readonly id: string;
  readonly name: string;
  readonly format: AnnotationFormat;
}

const formats: readonly Format[] = [
  { id: 'coco', name: 'COCO', format: AnnotationFormat.COCO },
  { id: 'yolo', name: 'YOLO', format: AnnotationFormat.YOLO },
  { id: 'labelme', name: 'LabelMe', format: AnnotationFormat.LABELME },
  { id: 'cvat', name: 'CVAT', format: AnnotationFormat.CVAT },
  { id: 'masks', name: 'PNG: a mask for each thing', format: AnnotationFormat.MASKS },
  { id: 'ids', name: 'PNG: a number for each thing', format: AnnotationFormat.IDS },
];
const levels: readonly Level[] = [0, 1, 2];

/** Returns what an export is asked with. `level`: all segments of it; undefined: all labels. */
export function annotationsRequest(
  model: string,
  { format }: Format,
  level: Level | undefined,
  table: boolean,
): AnnotationsRequest {
  const segments = level === undefined ? {} : { segments: { level } };
  return { model, format, table, ...segments };
}

/** Returns the name of the zip: "shelf-coco.zip", "shelf-objects-coco.zip". */
export function annotationsName(
  sceneId: string,
  { id }: Format,
  level: Level | undefined,
): string {
  const what = level === undefined ? [] : [`${levelNames[level].toLowerCase()}s`];
  return `${[sceneId, ...what, id].join('-')}.zip`;
}

export interface AnnotationProps {
  sceneId: string;
  model: string;
  labels: SceneLabels;
  everything: SceneEverything;
}

type Props = AnnotationProps & { running: RunningTask };

export function AnnotationTools(props: Props): JSX.Element {
  const { sceneId, model, labels, everything, running } = props;
  const named = useStore(labels.list);
  const { level: shownLevel } = useStore(everything.state);
  const { step } = useStore(running.state);
  const [format, setFormat] = useState(formats[0] as Format);
  /** Undefined: what the person has not chosen. */
  const [chosen, setChosen] = useState<Level | 'names'>();
  const [table, setTable] = useState(false);
  const what = chosen ?? (named.length > 0 ? 'names' : shownLevel);
  const level = what === 'names' ? undefined : what;
  const save = () =>
    running.run(async (steps) => {
      const made = steps('Segmenting', 'masks');
      const received = steps('Downloading', 'bytes');
      const watch = { made: made.progress, received: received.progress, signal: made.signal };
      const request = annotationsRequest(model, format, level, table);
      saveBlob(await fetchAnnotations(request, watch), annotationsName(sceneId, format, level));
    });
  return (
    <fieldset>
      <legend>All things in all photographs</legend>
      <label class="row">
        What
        <select
          value={what}
          onChange={({ currentTarget: { value } }) =>
            setChosen(value === 'names' ? value : (Number(value) as Level))
          }
        >
          <option value="names">{`All names (${named.length})`}</option>
          {levels.map((other) => (
            <option key={other} value={other}>
              {`All ${levelNames[other].toLowerCase()}s`}
            </option>
          ))}
        </select>
      </label>
      <label class="row">
        Format
        <select
          value={format.id}
          onChange={({ currentTarget: { value } }) =>
            setFormat(formats.find(({ id }) => id === value) ?? format)
          }
        >
          {formats.map(({ id, name }) => (
            <option key={id} value={id}>
              {name}
            </option>
          ))}
        </select>
      </label>
      <label class="check" title="Gaussians, views, pixels and box of each thing, as CSV">
        <input
          type="checkbox"
          checked={table}
          onChange={(event) => setTable(event.currentTarget.checked)}
        />
        With a table of the things
      </label>
      <button
        type="button"
        class="primary"
        disabled={step !== undefined || (what === 'names' && named.length === 0)}
        onClick={() => void save()}
      >
        Export (ZIP)
      </button>
    </fieldset>
  );
}
