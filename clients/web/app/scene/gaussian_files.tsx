// Files of Gaussians and meshes: of the scene, or of a part of it.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { GaussianFormat, MeshFormat } from '../../gen/pepeseg/v1/render_service_pb';
import { meshUrl, plyUrl } from '../api/clients';
import { fetchFile } from '../api/fetch_file';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { saveBlob } from '../mask/save_files';
import { useStore } from '../store';
import { useExportParts, withSelection } from './export_parts';
import type { RunningTask, Steps } from './running_task';
import type { SceneSelections } from './selections';

/** The files on offer. */
const gaussianFiles = [
  { word: 'PLY', ending: 'ply', format: GaussianFormat.PLY },
  { word: 'SPZ', ending: 'spz', format: GaussianFormat.SPZ },
  { word: 'glTF', ending: 'glb', format: GaussianFormat.GLB },
  { word: 'SOG', ending: 'sog', format: GaussianFormat.SOG },
  { word: 'web page', ending: 'html', format: GaussianFormat.HTML },
];
const meshFiles = [
  { word: 'PLY', ending: 'ply', format: MeshFormat.PLY },
  { word: 'GLB', ending: 'glb', format: MeshFormat.GLB },
];

interface Props {
  sceneId: string;
  model: string;
  selections: SceneSelections;
  edits: GaussianEdits;
  running: RunningTask;
}

function fetchMesh(url: string, steps: Steps): Promise<Blob> {
  const making = steps('Making the mesh', 'bytes');
  const receiving = steps('Downloading', 'bytes');
  const progress = (done: number, total: number) =>
    (total === 0 ? making : receiving).progress(done, total);
  return fetchFile(url, { progress, signal: making.signal });
}

export function GaussianFiles(props: Props): JSX.Element {
  const { sceneId, model, selections, edits, running } = props;
  const { step } = useStore(running.state);
  const parts = useExportParts(selections, edits);
  const [chosen, setChosen] = useState('scene');
  const [watertight, setWatertight] = useState(false);
  const part = parts.find(({ id }) => id === chosen) ?? parts[0];
  if (!part) return <></>;
  const stem = part.id === 'scene' ? sceneId : `${sceneId}-${part.id}`;
  const save = (name: string, fetched: (of: { selection?: string }, steps: Steps) => Promise<Blob>) =>
    void running.run((steps) =>
      withSelection(model, part, steps, async (selection) => {
        saveBlob(await fetched(selection ? { selection } : {}, steps), name);
      }),
    );
  const button = (word: string, title: string, onClick: () => void) => (
    <button
      key={word}
      type="button"
      aria-label={`${title} (${word})`}
      disabled={step !== undefined}
      onClick={onClick}
    >
      {word}
    </button>
  );
  return (
    <fieldset>
      <legend>Gaussians and meshes</legend>
      {parts.length > 1 && (
        <label class="row">
          Of
          <select value={part.id} onChange={(event) => setChosen(event.currentTarget.value)}>
            {parts.map(({ id, title }) => (
              <option key={id} value={id}>
                {title}
              </option>
            ))}
          </select>
        </label>
      )}
      <div class="files" role="group" aria-label={`${part.title}: Gaussians`}>
        <span class="quiet">Gaussians</span>
        {gaussianFiles.map(({ word, ending, format }) =>
          button(word, part.title, () =>
            save(`${stem}.${ending}`, (of, steps) =>
              fetchFile(plyUrl(model, { ...of, format }), steps('Downloading', 'bytes')),
            ),
          ),
        )}
      </div>
      <div class="files" role="group" aria-label={`${part.title}: mesh`}>
        <span class="quiet">Mesh</span>
        {meshFiles.map(({ word, ending, format }) =>
          button(word, `${part.title} mesh`, () =>
            save(`${stem}-mesh.${ending}`, (of, steps) =>
              fetchMesh(meshUrl(model, { ...of, format, watertight }), steps),
            ),
          ),
        )}
        <label class="check" title="Closes the surface, also where no photograph looks">
          <input
            type="checkbox"
            checked={watertight}
            onChange={(event) => setWatertight(event.currentTarget.checked)}
          />
          Watertight
        </label>
      </div>
    </fieldset>
  );
}
