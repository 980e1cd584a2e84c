import type { JSX } from 'preact';
import { useEffect, useState } from 'preact/hooks';
import { photoUrl } from '../api/clients';
import { Icon } from './icons';

/** One of the scene's photographs, or a sign that there is none to show. */
export function ScenePhoto({ scene }: { scene: string }): JSX.Element {
  const [missing, setMissing] = useState(false);
  useEffect(() => setMissing(false), [scene]);
  if (missing) return <Icon name="photo" />;
  return <img src={photoUrl(scene)} alt="" loading="lazy" onError={() => setMissing(true)} />;
}
