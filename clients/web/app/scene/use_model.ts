// Everything that the screen of a scene works with: the state of each of its sections.
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { Drafting } from '../edit/drafting';
import { SceneEditor } from '../edit/scene_editor';
import { SceneVersions } from '../edit/versions';
import { steadily } from '../api/server_link';
import { GaussianEdits } from '../gaussians/gaussian_edits';
import { StoredPicks } from '../gaussians/stored_picks';
import { History } from '../history';
import { useStore } from '../store';
import { SceneEverything } from './everything';
import { SceneFinder } from './finder';
import { colorOf } from './found_things';
import { SceneLabels, labelName } from './labels';
import type { NamedMask } from './photo_view';
import type { Prompt } from './prompt';
import { SceneSelections } from './selections';
import { SceneSession } from './session';
import type { Subject } from './subject';
import { isJob } from './subject';
import type { TintedThings } from './splat_parts';
import { ThingMasks } from './thing_masks';
import { ThingsIn3d } from './things_in_3d';

/** What all models of a scene share. */
function sharedOf(scene: string, show: (model: string) => void) {
  const history = new History();
  const versions = new SceneVersions(scene);
  return {
    history,
    versions,
    labels: new SceneLabels(scene, history),
    editor: new SceneEditor(history, { show, changed: () => void versions.load() }),
  };
}

type Shared = ReturnType<typeof sharedOf>;

function partsOf(subject: Subject, views: readonly View[], { history, labels, editor }: Shared) {
  const { model } = subject;
  const selections = new SceneSelections(model, history);
  const edits = new GaussianEdits(model, history, editor.takePicks(model));
  return {
    session: new SceneSession(
      model,
      views.map(({ view }) => view),
      history,
    ),
    selections,
    things: new ThingMasks(model, labels),
    thingsIn3d: new ThingsIn3d(model, labels),
    finder: new SceneFinder(model),
    everything: new SceneEverything(model, selections),
    edits,
    drafting: new Drafting(edits),
    storedPicks: new StoredPicks(subject, edits, history),
  };
}

type Parts = ReturnType<typeof partsOf>;

/**
 * Returns the state of a model, and what it shares with the other models of the scene. A model that is shown again
 * has the state with which it was left, to which the history leads. `onModel`: shows another model of the scene.
 */
export function useModel(
  subject: Subject,
  views: readonly View[],
  onModel: (model: string) => void,
): Parts & Shared {
  const { scene, model } = subject;
  const newest = useRef(onModel);
  newest.current = onModel;
  // A job that has made its model is another beginning: its clicks cannot be asked again.
  const isTraining = isJob(model);
  const { shared, left } = useMemo(() => {
    const show = (to: string) => newest.current(to);
    return { shared: sharedOf(scene, show), left: new Map<string, Parts>() };
  }, [scene, isTraining]);
  const parts = useMemo(() => {
    const made = left.get(model) ?? partsOf(subject, views, shared);
    left.set(model, made);
    return made;
  }, [left, model, views]);
  useEffect(() => {
    const controller = new AbortController();
    const { signal } = controller;
    // Everything else works without labels and stored picks; a fault of the server shows at the next request.
    steadily(() => shared.labels.load(signal), signal).catch(() => undefined);
    if (!isTraining) {
      steadily(() => parts.storedPicks.load(signal), signal).catch(() => undefined);
      void shared.versions.load(signal);
      parts.edits.begin();
    }
    return () => {
      controller.abort();
      parts.session.end();
      parts.finder.clear();
      parts.everything.end();
      parts.things.end();
      parts.thingsIn3d.turn(false);
      parts.drafting.end();
      parts.edits.end();
    };
  }, [parts]);
  useEffect(() => () => shared.editor.task.cancel(), [shared]);
  return useMemo(() => ({ ...shared, ...parts }), [shared, parts]);
}

/** Asks the model of a job what the job was asked. Its scales are its own: the size is not kept. */
export function useKeptPrompt(session: SceneSession): void {
  const before = useRef(session);
  useEffect(() => {
    const { model, state } = before.current;
    const { prompt } = state.get();
    if (before.current !== session && isJob(model) && prompt) session.pose(prompt);
    before.current = session;
  }, [session]);
}

/** Returns what to draw of what was found: nothing while a segment is shown. */
export function useFound(finder: SceneFinder, isShown: boolean) {
  const { found, masks } = useStore(finder.state);
  return useMemo(() => {
    const things = isShown ? (found?.things ?? []) : [];
    return {
      masks: things.flatMap((_, i): NamedMask[] => {
        const mask = masks.get(i);
        if (!mask || mask.area === 0) return [];
        return [{ name: `${i + 1}`, rle: mask.rle, color: colorOf(i) }];
      }),
      boxes: things.flatMap(({ appearances }, i) =>
        appearances.map((appearance) => ({ ...appearance, color: colorOf(i) })),
      ),
    };
  }, [found, masks, isShown]);
}

/** Returns the masks of the named things in the shown view, but for that of the prompt. */
export function useThings(
  things: ThingMasks,
  labels: SceneLabels,
  prompt: Prompt | undefined,
): readonly NamedMask[] {
  const { isOn, hidden, masks } = useStore(things.state);
  const list = useStore(labels.list);
  const current = prompt?.kind === 'label' ? prompt.label : undefined;
  return useMemo(() => {
    if (!isOn) return [];
    return list.flatMap((label, i) => {
      const mask = masks.get(label.name);
      if (!mask || mask.area === 0 || hidden.has(label.name) || label.name === current) return [];
      return [{ name: labelName(label), rle: mask.rle, color: colorOf(i) }];
    });
  }, [isOn, hidden, masks, list, current]);
}

/** Returns the named things as the 3D view draws them; undefined: not in their colours. */
export function useTintedThings(
  things: ThingMasks,
  thingsIn3d: ThingsIn3d,
  labels: SceneLabels,
): TintedThings | undefined {
  const { hidden } = useStore(things.state);
  const { things: selected } = useStore(thingsIn3d.state);
  const list = useStore(labels.list);
  return useMemo(() => {
    if (!selected) return undefined;
    const parts = selected.parts.map(({ label, selection }) => {
      const index = list.findIndex(({ name }) => name === label);
      const isShown = index >= 0 && !hidden.has(label);
      return { selection, color: isShown ? colorOf(index) : undefined };
    });
    return { all: selected.all, parts };
  }, [selected, hidden, list]);
}
