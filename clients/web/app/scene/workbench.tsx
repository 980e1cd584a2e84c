// The screen for segmenting a scene: views, 3D view and tools side by side, or one at a time.
import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import type { Scene, View } from '../../gen/pepeseg/v1/scene_service_pb';
import { photoUrl, pictureUrl, sceneIdOf } from '../api/clients';
import { steadily } from '../api/server_link';
import { useAsked } from '../api/use_asked';
import { FailureNote } from '../components/failure_note';
import { Icon } from '../components/icons';
import { useStore } from '../store';
import { useNarrow } from '../use_narrow';
import { firstBrush, withWidth } from './brush';
import { describeAnswer } from './describe_answer';
import { DownloadTools } from './download_tools';
import { Filmstrip, thumbnailSide } from './filmstrip';
import { FindTools, findAlike } from './find_tools';
import { SceneFinder } from './finder';
import { colorOf } from './found_things';
import { LabelTools } from './label_tools';
import { SceneLabels } from './labels';
import type { FoundMask, Source, Tool } from './photo_view';
import { PhotoView } from './photo_view';
import { placeOf, samePlace, sizeOf } from './prompt';
import { GranularityTools, PromptTools, PromptButtons } from './segment_tools';
import { SelectionTools, selectWith } from './selection_tools';
import { SceneSelections } from './selections';
import { serverHasSam } from './server_sam';
import { SceneSession } from './session';
import { ShortcutList, useShortcuts } from './shortcuts';
import { SplatPane } from './splat_pane';

function useModel(scene: Scene, views: readonly View[]) {
  const model = scene.liveModel;
  const parts = useMemo(
    () => ({
      session: new SceneSession(
        model,
        views.map(({ view }) => view),
      ),
      selections: new SceneSelections(model),
      labels: new SceneLabels(scene.name),
      finder: new SceneFinder(model),
    }),
    [model, views],
  );
  useEffect(() => {
    const controller = new AbortController();
    const { signal } = controller;
    // Everything else works without labels; a fault of the server shows at the next request.
    steadily(() => parts.labels.load(signal), signal).catch(() => undefined);
    return () => {
      controller.abort();
      parts.session.end();
      parts.finder.clear();
    };
  }, [parts]);
  return parts;
}

/** Returns what to draw of what was found: nothing while a segment is shown. */
function useFound(finder: SceneFinder, isShown: boolean) {
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

/** Maximum of the shown photograph's longer side, pixels: more than most screens have. */
const photoSide = 2048;

interface Props {
  scene: Scene;
  views: readonly View[];
}

export function SceneWorkbench({ scene, views }: Props): JSX.Element {
  const { session, selections, labels, finder } = useModel(scene, views);
  const [view, setView] = useState(views[0]);
  const [tool, setTool] = useState<Tool>('include');
  const [brush, setBrush] = useState(firstBrush);
  const [pane, setPane] = useState<'view' | '3d'>('view');
  const [source, setSource] = useState<Source>('photo');
  const [help, setHelp] = useState(false);
  const narrow = useNarrow();
  const hasSam = useAsked(
    (signal) => serverHasSam(scene.liveModel, signal),
    [scene.liveModel],
  );
  useEffect(() => {
    if (hasSam.value) session.setSamClicks('auto');
  }, [session, hasSam.value]);
  const renderingOf = (of: View) => pictureUrl(session.model, of.view);
  const thumbnailOf = (of: View) =>
    photoUrl(session.model, { name: of.view, maxSide: thumbnailSide });
  const state = useStore(session.state);
  const { prompt, answer, failure, miss, numAnswers, busy, looking } = state;
  const { selection, showing } = useStore(selections.state);
  const shown = view?.view ?? '';
  useEffect(() => {
    session.show(shown);
    finder.show(shown);
  }, [session, finder, shown]);
  const found = useFound(finder, prompt === undefined);

  const step = (by: number) => {
    const next =
      views[(views.findIndex((other) => other.view === shown) + by + views.length) % views.length];
    if (next) setView(next);
  };
  const size = (index: number) => () => {
    session.climb(index);
    session.rest();
  };
  useShortcuts({
    '?': () => setHelp(true),
    'Ctrl+z': () => session.undo(),
    Escape: () => session.clear(),
    '[': () => step(-1),
    ']': () => step(1),
    ...Object.fromEntries([0, 1, 2, 3, 4, 5].map((index) => [String(index + 1), size(index)])),
    i: () => setTool('include'),
    e: () => setTool('exclude'),
    b: () => setTool('box'),
    p: () => setTool('brush'),
    x: () => tool === 'brush' && setBrush({ ...brush, negative: !brush.negative }),
    '+': () => tool === 'brush' && setBrush(withWidth(brush, brush.width + 2)),
    '-': () => tool === 'brush' && setBrush(withWidth(brush, brush.width - 2)),
    v: () => setSource(source === 'photo' ? 'rendering' : 'photo'),
    a: () => hasSam.value === true && findAlike(session, finder),
    '/': () => document.getElementById('find-text')?.focus(),
    l: () => document.getElementById('label-text')?.focus(),
    s: () => selectWith(session, selections, 'select'),
    t: () => selections.show('tinted'),
    o: () => selections.show('isolated'),
    h: () => selections.show('hidden'),
  });
  if (!view) return <p class="loading">The model has no views.</p>;

  const { width, height } = sizeOf(view);
  const place = { view: shown };
  const here = samePlace(placeOf(prompt), place) ? prompt : undefined;
  return (
    <div class="workbench" style={{ '--ratio': `${width / height}` }}>
      {narrow && (
        <div class="segmented panes" role="group" aria-label="What is shown">
          <button type="button" aria-pressed={pane === 'view'} onClick={() => setPane('view')}>
            <Icon name="photo" /> Views
          </button>
          <button type="button" aria-pressed={pane === '3d'} onClick={() => setPane('3d')}>
            <Icon name="cube" /> 3D
          </button>
        </div>
      )}
      {(!narrow || pane === 'view') && (
        <PhotoView
          view={view}
          photo={photoUrl(session.model, { name: shown, maxSide: photoSide })}
          rendering={renderingOf(view)}
          source={source}
          onSource={setSource}
          mask={answer?.masks.get(shown)}
          found={found.masks}
          prompt={here}
          miss={samePlace(miss?.place, place) ? miss : undefined}
          tool={tool}
          brush={brush}
          numAnswers={numAnswers}
          onPoint={(point) => session.addPoint(place, point)}
          onBox={(box) => session.pose({ kind: 'box', place, box })}
          onStroke={(stroke) => session.addStroke(place, stroke)}
        />
      )}
      {(!narrow || pane === '3d') && (
        <SplatPane
          model={session.model}
          views={views}
          view={view}
          mask={answer?.masks.get('')}
          prompt={prompt}
          miss={miss}
          tool={tool}
          selection={selection?.name}
          showing={showing}
          onPoint={(camera, point) => session.addPoint({ camera }, point)}
        />
      )}
      <Filmstrip
        views={views}
        current={shown}
        masks={answer?.masks}
        found={found.boxes}
        photoOf={thumbnailOf}
        renderingOf={renderingOf}
        onPick={setView}
      />
      <aside class="tools" aria-label="Tools">
        <section aria-labelledby="segment-title">
          <div class="row">
            <h2 id="segment-title">Segment</h2>
            <span class="spacer" />
            <PromptButtons session={session} />
            <button
              type="button"
              class="bare"
              aria-label="Keyboard and mouse"
              title="Keyboard and mouse (?)"
              onClick={() => setHelp(true)}
            >
              <Icon name="help" />
            </button>
          </div>
          <PromptTools
            tool={tool}
            onTool={setTool}
            brush={brush}
            onBrush={setBrush}
            viewWidth={width}
          />
          <p class={`quiet ${prompt ? 'said' : ''}`} role="status" aria-busy={busy || looking}>
            {prompt
              ? describeAnswer(state, shown, session.views)
              : 'Click a thing in the view or in 3D.'}
          </p>
          <FailureNote failure={failure} close={() => session.closeFailure()} />
          <GranularityTools session={session} hasSam={hasSam.value === true} />
        </section>
        <FindTools
          session={session}
          finder={finder}
          labels={labels}
          views={views}
          hasSam={hasSam.value === true}
          photoOf={thumbnailOf}
        />
        <SelectionTools session={session} selections={selections} />
        <LabelTools session={session} labels={labels} shownView={shown} />
        <DownloadTools
          sceneId={sceneIdOf(scene.name)}
          session={session}
          selections={selections}
          labels={labels}
          views={views}
        />
      </aside>
      {help && <ShortcutList onClose={() => setHelp(false)} />}
    </div>
  );
}
