import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { datasets, photoUrl, pictureUrl } from '../api/clients';
import { useAsked } from '../api/use_asked';
import { Icon } from './icons';

/** Longer side of a picture on a card, pixels: twice its size on the screen. */
const cardSide = 640;

interface Props {
  scene: string;
  /** The dataset or model that has the photograph; absent: the scene's newest dataset. */
  parent?: string;
  /** View of the model `parent` to render if there is no photograph, as for a video. */
  rendering?: string | undefined;
}

/** The scene's first photograph, or a placeholder if there is none. */
export function ScenePhoto({ scene, parent, rendering }: Props): JSX.Element {
  const [missing, setMissing] = useState<readonly string[]>([]);
  const newest = useAsked(
    async (signal) =>
      parent ||
      (await datasets.listDatasets({ parent: scene, pageSize: 1000 }, { signal })).datasets.at(-1)
        ?.name,
    [scene, parent],
  );
  useEffect(() => setMissing([]), [scene]);
  const urls = [
    newest.value && photoUrl(newest.value, { maxSide: cardSide }),
    parent && rendering && pictureUrl(parent, rendering, cardSide),
  ];
  const url = urls.find((candidate) => candidate && !missing.includes(candidate));
  if (!url) return <Icon name="photo" />;
  return (
    <img src={url} alt="" loading="lazy" onError={() => setMissing([...missing, url])} />
  );
}
