import { useEffect, useMemo, useState } from 'preact/hooks';

/** True on narrow screens: one pane at a time. */
export function useNarrow(): boolean {
  const media = useMemo(() => window.matchMedia('(max-width: 800px)'), []);
  const [narrow, setNarrow] = useState(media.matches);
  useEffect(() => {
    const change = () => setNarrow(media.matches);
    media.addEventListener('change', change);
    return () => media.removeEventListener('change', change);
  }, [media]);
  return narrow;
}
