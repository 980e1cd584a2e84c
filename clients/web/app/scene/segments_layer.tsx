// All segments of the shown view, drawn over its photograph.
import type { JSX } from 'preact';
import { useLayoutEffect, useMemo, useRef } from 'preact/hooks';
import { paintSegments, shrunkGrey } from '../mask/paint_segments';
import { useStore } from '../store';
import type { SceneEverything } from './everything';
import type { SegmentNames } from './segment_names';
import { segmentColor, segmentName } from './segments';

/** Maximum of the longer side of what is drawn, pixels. */
const maxSide = 1280;

interface Props {
  everything: SceneEverything;
  view: string;
  /** Whether a segment is shown, next to which the others are faint. */
  isFaint: boolean;
}

export function SegmentsLayer({ everything, view, isFaint }: Props): JSX.Element {
  const { isOn, level, seen, hidden } = useStore(everything.state);
  const under = useStore(everything.under);
  const canvas = useRef<HTMLCanvasElement>(null);
  const ids = isOn && seen?.view === view && seen.level === level ? seen.picture : undefined;
  const drawn = useMemo(() => ids && shrunkGrey(ids, maxSide), [ids]);
  // Before the next frame, since somebody watches it follow the pointer.
  useLayoutEffect(() => {
    if (!canvas.current) return;
    paintSegments(canvas.current, drawn, {
      colorOf: segmentColor,
      emphasised: under,
      isHidden: (id) => everything.isHidden({ level, id }),
      isFaint,
    });
  }, [drawn, under, hidden, isFaint]);
  return (
    <canvas
      ref={canvas}
      class="overlay segments"
      aria-hidden="true"
      data-level={drawn ? level : ''}
      data-under={under}
    />
  );
}

interface UnderProps {
  everything: SceneEverything;
  names: SegmentNames;
}

/** The name of the segment under the pointer, over the photograph. */
export function SegmentUnder({ everything, names }: UnderProps): JSX.Element | null {
  const { isOn, level } = useStore(everything.state);
  const under = useStore(everything.under);
  if (!isOn || under === 0) return null;
  return (
    <p class="segment-under" aria-hidden="true">
      {names.get(under) ?? segmentName({ level, id: under })}
    </p>
  );
}
