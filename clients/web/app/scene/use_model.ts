// Everything that the screen of a scene works with: the state of each of its sections.
import { useEffect, useMemo, useRef } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { steadily } from '../api/server_link';
import { GaussianEdits } from '../gaussians/gaussian_edits';
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
import type { TintedThings } from './splat_parts';
import { ThingMasks } from './thing_masks';
import { ThingsIn3d } from './things_in_3d';

export function useModel({ scene, model }: Subject, views: readonly View[]) {
  const parts = useMemo(() => {
    const history = new History();
    const selections = new SceneSelections(model, history);
    const labels = new SceneLabels(scene, history);
    return {
      history,
      session: new SceneSession(
        model,
        views.map(({ view }) => view),
        history,
      ),
      selections,
      labels,
      things: new ThingMasks(model, labels),
      thingsIn3d: new ThingsIn3d(model, labels),
      finder: new SceneFinder(model),
      everything: new SceneEverything(model, selections),
      edits: new GaussianEdits(model, history),
    };
  }, [model, views]);
  useEffect(() => {
    const controller = new AbortController();
    const { signal } = controller;
    // Everything else works without labels; a fault of the server shows at the next request.
    steadily(() => parts.labels.load(signal), signal).catch(() => undefined);
    return () => {
      controller.abort();
      parts.session.end();
      parts.finder.clear();
      parts.everything.turn(false);
      parts.things.end();
      parts.thingsIn3d.turn(false);
      parts.edits.end();
    };
  }, [parts]);
  return parts;
}

/** Asks a new model what the model before it was asked. Its scales are its own: the size is not kept. */
export function useKeptPrompt(session: SceneSession): void {
  const before = useRef(session);
  useEffect(() => {
    const { prompt } = before.current.state.get();
    if (before.current !== session && prompt) session.pose(prompt);
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
