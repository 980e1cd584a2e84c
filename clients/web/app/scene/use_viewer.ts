// The viewer of the 3D view: made once, then what it draws follows the state.
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import type { Draft, Drafting } from '../edit/drafting';
import { colorOfText } from '../edit/drafting';
import type { GaussianEdits } from '../gaussians/gaussian_edits';
import { unseenOf } from '../gaussians/gaussian_edits';
import { combined } from '../gaussians/gaussian_set';
import type { Picking } from '../gaussians/use_picking';
import { queryValue, setQueryValue } from '../router';
import { useStore } from '../store';
import { placeText, readPlace } from '../viewer/camera_text';
import type { SplatViewer } from '../viewer/splat_viewer';
import type { Showing } from './selections';
import type { TintedThings } from './splat_parts';
import { splatParts } from './splat_parts';

/** What the 3D view shows. */
export interface Viewed {
  model: string;
  views: readonly View[];
  /** Camera to look from; the view moves there when it changes. */
  view: View;
  selection: string | undefined;
  showing: Showing;
  /** Named things in their colours, while no selection is shown. */
  things: TintedThings | undefined;
  edits: GaussianEdits;
  drafting: Drafting;
  picking: Picking;
}

type Status = 'loading' | 'ready' | { error: string };

/** Name of the camera's place in the URL's query. */
const placeName = 'at';
/** How long the camera rests before its place is in the URL, milliseconds. */
const restTime = 300;

/** Draws the Gaussians of a move where it leads, with handles that drag them. */
function useMoved(
  draft: Draft | undefined,
  { edits, drafting }: Viewed,
  viewer: { readonly current: SplatViewer | undefined },
  made: number,
): void {
  const move = draft?.kind === 'move' ? draft : undefined;
  const newest = useRef(drafting);
  newest.current = drafting;
  // The pivot stays the same object while a draft lasts.
  useEffect(() => {
    const moved = viewer.current?.moved;
    if (!moved || !move) return undefined;
    let isOver = false;
    const { picked } = edits.state.get().edits;
    void edits.plyOf(picked).then((file) => {
      // Numbers may have been typed meanwhile.
      const now = drafting.state.get();
      if (isOver || now?.kind !== 'move') return;
      void moved.begin(file, now.pivot, (to) => drafting.moveTo(to));
      moved.setMode(now.mode);
      moved.put(now.move);
    });
    return () => {
      isOver = true;
      // If the move was made, it is seen until the new model is.
      if (newest.current === drafting) moved.stop();
    };
  }, [made, drafting, move?.pivot]);
  useEffect(() => move && viewer.current?.moved.setMode(move.mode), [made, move?.mode]);
  useEffect(() => move && viewer.current?.moved.put(move.move), [made, move?.move]);
}

/** Returns how the Gaussians are drawn; undefined: as they are. */
function useMarks({ model, edits }: Viewed, draft: Draft | undefined) {
  const { gaussians, edits: edited } = useStore(edits.state);
  // What is moved is drawn where it is moved to; what is copied is drawn here, too.
  const isMoved = draft?.kind === 'move' && !draft.copy;
  const newColor = draft?.kind === 'recolor' ? draft : undefined;
  return useMemo(() => {
    if (!gaussians) return undefined;
    const { picked } = edited;
    const unseen = unseenOf(edited, gaussians);
    return {
      model,
      centers: gaussians.centers,
      picked,
      hidden: isMoved ? combined(unseen, picked, 'add') : unseen,
      newColor: newColor && { ...newColor, color: colorOfText(newColor.color) },
    };
  }, [model, gaussians, edited, isMoved, newColor]);
}

export function useViewer(props: Viewed, onMoved: () => void) {
  const { model, views, view, selection, showing, things, edits, picking } = props;
  const canvas = useRef<HTMLCanvasElement>(null);
  const viewer = useRef<SplatViewer | undefined>(undefined);
  const [status, setStatus] = useState<Status>('loading');
  const [made, setMade] = useState(0);
  const [shown, setShown] = useState<Showing>();
  const resting = useRef(0);
  const moved = useRef(onMoved);
  moved.current = () => {
    onMoved();
    clearTimeout(resting.current);
    resting.current = window.setTimeout(() => {
      const place = viewer.current?.place();
      setQueryValue(placeName, place && placeText(place));
    }, restTime);
  };
  useEffect(() => {
    let gone = false;
    // three.js and Spark are most of the app's bytes: they are loaded when they are needed.
    import('../viewer/splat_viewer').then(
      (module) => {
        if (gone || !canvas.current) return;
        try {
          viewer.current = new module.SplatViewer(canvas.current, views, () => moved.current());
          setMade((n) => n + 1);
        } catch {
          setStatus({
            error: 'This browser shows no 3D (WebGL 2). Segmenting photographs works all the same.',
          });
        }
      },
      () => setStatus({ error: 'The 3D view could not be loaded: reload the page.' }),
    );
    return () => {
      gone = true;
      clearTimeout(resting.current);
      viewer.current?.end();
      viewer.current = undefined;
    };
  }, [views]);
  useEffect(() => {
    if (!viewer.current) return;
    // An earlier request may still end, and after this one.
    let outdated = false;
    setStatus('loading');
    viewer.current.load(model, splatParts(model, selection, showing, things)).then(
      () => {
        if (outdated) return;
        setStatus('ready');
        setShown(showing);
      },
      (error: Error) => {
        if (!outdated && error.name !== 'AbortError') setStatus({ error: error.message });
      },
    );
    return () => {
      outdated = true;
    };
  }, [made, model, selection, showing, things]);
  useEffect(() => viewer.current?.goTo(view), [made, view]);
  // After the view's camera: the place that the address says.
  useEffect(() => {
    const place = readPlace(queryValue(placeName));
    if (place) viewer.current?.putAt(place);
  }, [made]);
  const draft = useStore(props.drafting.state);
  const marks = useMarks(props, draft);
  useEffect(() => viewer.current?.mark(marks), [made, marks]);
  useMoved(draft, props, viewer, made);
  const { crop } = useStore(edits.state).edits;
  useEffect(() => viewer.current?.showCrop(crop), [made, crop]);
  const turns = picking.drag === 'turn' || draft?.kind === 'move';
  useEffect(() => viewer.current?.letTurn(turns), [made, turns]);
  return { canvas, viewer, status, shown, made };
}

