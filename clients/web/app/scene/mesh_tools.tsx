// Exports the scene, or the selection, as triangles.
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { MeshFormat } from '../../gen/pepeseg/v1/render_service_pb';
import { meshUrl } from '../api/clients';
import { fetchFile } from '../api/fetch_file';
import { saveBlob } from '../mask/save_files';
import { useStore } from '../store';
import type { RunningExport } from './running_export';

const meshFiles = [
  { word: 'PLY', ending: 'ply', format: MeshFormat.PLY },
  { word: 'GLB', ending: 'glb', format: MeshFormat.GLB },
];

interface Props {
  sceneId: string;
  model: string;
  /** Name of the selection in 3D; undefined: there is none. */
  selection: string | undefined;
  running: RunningExport;
}

export function MeshTools({ sceneId, model, selection, running }: Props): JSX.Element {
  const { step } = useStore(running.state);
  const [watertight, setWatertight] = useState(false);
  const save = (url: string, name: string) =>
    running.run(async (steps) => {
      const making = steps('Making the mesh', 'bytes');
      const receiving = steps('Downloading', 'bytes');
      const progress = (done: number, total: number) =>
        (total === 0 ? making : receiving).progress(done, total);
      saveBlob(await fetchFile(url, { progress, signal: making.signal }), name);
    });
  const buttons = (title: string, stem: string, of?: string) =>
    meshFiles.map(({ word, ending, format }) => {
      const url = meshUrl(model, { format, watertight, ...(of && { selection: of }) });
      return (
        <button
          key={`${title} ${word}`}
          type="button"
          disabled={step !== undefined}
          onClick={() => void save(url, `${stem}-mesh.${ending}`)}
        >
          {`${title} (${word})`}
        </button>
      );
    });
  return (
    <fieldset>
      <legend>Mesh</legend>
      <div class="downloads">
        {buttons('Scene mesh', sceneId)}
        {selection && buttons('Selection mesh', `${sceneId}-selection`, selection)}
      </div>
      <label class="check" title="Closes the surface, also where no photograph looks">
        <input
          type="checkbox"
          checked={watertight}
          onChange={(event) => setWatertight(event.currentTarget.checked)}
        />
        Watertight
      </label>
    </fieldset>
  );
}
