// What the screen of a scene works with: the state of each of its sections.
import { useEffect, useMemo } from 'preact/hooks';
import type { Scene, View } from '../../gen/pepeseg/v1/scene_service_pb';
import { steadily } from '../api/server_link';
import { useStore } from '../store';
import { SceneEverything } from './everything';
import { SceneFinder } from './finder';
import { colorOf } from './found_things';
import { SceneLabels } from './labels';
import type { FoundMask } from './photo_view';
import { SceneSelections } from './selections';
import { SceneSession } from './session';

export function useModel(scene: Scene, views: readonly View[]) {
  const model = scene.liveModel;
  const parts = useMemo(() => {
    const selections = new SceneSelections(model);
    return {
      session: new SceneSession(
        model,
        views.map(({ view }) => view),
      ),
      selections,
      labels: new SceneLabels(scene.name),
      finder: new SceneFinder(model),
      everything: new SceneEverything(model, selections),
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
    };
  }, [parts]);
  return parts;
}

/** Returns what to draw of what was found: nothing while a segment is shown. */
export function useFound(finder: SceneFinder, isShown: boolean) {
  const { found, masks } = useStore(finder.state);
  return useMemo(() => {
    const things = isShown ? (found?.things ?? []) : [];
    return {
      masks: things.flatMap((_, i): FoundMask[] => {
        const mask = masks.get(i);
        if (!mask || mask.area === 0) return [];
        return [{ number: i + 1, rle: mask.rle, color: colorOf(i) }];
      }),
      boxes: things.flatMap(({ appearances }, i) =>
        appearances.map((appearance) => ({ ...appearance, color: colorOf(i) })),
      ),
    };
  }, [found, masks, isShown]);
}
