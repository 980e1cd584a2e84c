// The pictures of the pane of photographs: photographs, or renderings of a version that an edit has made.
import { useRef, useState } from 'preact/hooks';
import { photoUrl, pictureUrl } from '../api/clients';
import type { SceneVersions } from '../edit/versions';
import { isEdited } from '../edit/versions';
import { useStore } from '../store';
import type { Source } from './photo_view';
import type { Subject } from './subject';

interface Chosen {
  readonly model: string;
  readonly source: Source;
}

export function useSource({ model, photos }: Subject, versions: SceneVersions) {
  const { list } = useStore(versions.state);
  const [chosen, setChosen] = useState<Chosen>();
  /** Source of the newest model in the list; a model that is not there yet has the same. */
  const known = useRef<Source>('photo');
  const edited = isEdited(list, model);
  if (list.some(({ name }) => name === model)) known.current = edited ? 'rendering' : 'photo';
  const source = chosen?.model === model ? chosen.source : known.current;
  return {
    source,
    setSource: (to: Source) => setChosen({ model, source: to }),
    isEdited: edited,
    /** Returns the URL of a small picture of a view, which shows the edit if the large one does. */
    thumbnailOf: (view: string, maxSide: number) =>
      edited && source === 'rendering'
        ? pictureUrl(model, view, maxSide)
        : photoUrl(photos, { name: view, maxSide }),
  };
}
