// The screen for segmenting a scene: photograph and 3D, the strip of views and the side panel.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import type { View } from '../../gen/pepeseg/v1/scene_service_pb';
import { photoUrl, pictureUrl, sceneIdOf } from '../api/clients';
import { useAsked } from '../api/use_asked';
import { Advice } from '../components/advice';
import { applyDraft } from '../edit/draft_tools';
import type { DragTool, Picking } from '../gaussians/use_picking';
import { dragTools } from '../gaussians/use_picking';
import { useStore } from '../store';
import { useNarrow } from '../use_narrow';
import { firstBrush, withWidth } from './brush';
import { Filmstrip, thumbnailSide } from './filmstrip';
import { findAlike } from './find_tools';
import { labelColor } from './labels';
import type { Layout } from './layout';
import { panesOn } from './layout';
import { useLinkedText, useLinkedWord } from './link_state';
import { drawWith } from './mask_tools';
import { PhotoView } from './photo_view';
import type { FreeCamera, Point, Prompt } from './prompt';
import { placeOf, samePlace, sizeOf } from './prompt';
import { useSegmentNames } from './segment_names';
import { selectWith } from './selection_tools';
import { serverHasSam } from './server_sam';
import type { Shortcuts } from './shortcuts';
import { ShortcutList, useShortcuts } from './shortcuts';
import { SplatPane } from './splat_pane';
import type { Subject } from './subject';
import { isJob } from './subject';
import { ToolPanel } from './tool_panel';
import { FoldedStatus } from './tool_rail';
import { isWide, tools } from './use_drawing';
import { useFound, useKeptPrompt, useModel, useThings, useTintedThings } from './use_model';
import { useSource } from './use_source';

interface Props {
  subject: Subject;
  views: readonly View[];
  layout: Layout;
  /** Shows another model of the scene. */
  onModel: (model: string) => void;
}

const editedAdvice = 'Photographs do not show this edit, so these are renderings.';

/** Returns true from the first time on that a condition holds. */
function useOnce(holds: boolean): boolean {
  const held = useRef(holds);
  held.current ||= holds;
  return held.current;
}

export function SceneWorkbench({ subject, views, layout, onModel }: Props): JSX.Element {
  const isTraining = isJob(subject.model);
  const model = useModel(subject, views, onModel);
  const { session, selections, labels, finder, everything, things, thingsIn3d, edits, history } = model;
  const { drafting, versions } = model;
  const [viewName, setViewName] = useLinkedText('view');
  const view = views.find((other) => other.view === viewName) ?? views[0];
  const setView = (to: View) => setViewName(to.view);
  const [tool, setTool] = useLinkedWord('tool', tools);
  const [brush, setBrush] = useState(firstBrush);
  const { source, setSource, ...pictures } = useSource(subject, versions);
  const [drag, setDrag] = useLinkedWord('drag', dragTools);
  const [frontOnly, setFrontOnly] = useState(false);
  const picking = { drag, frontOnly };
  const setPicking = (next: Picking) => {
    setDrag(next.drag);
    setFrontOnly(next.frontOnly);
  };
  const [cameras, setCameras] = useLinkedWord('cameras', ['off', 'on']);
  const [help, setHelp] = useState(false);
  /** The prompt of the last click in 3D. */
  const promptIn3d = useRef<Prompt | undefined>(undefined);
  const narrow = useNarrow();
  const panes = isTraining ? 'photo' : panesOn(narrow, layout.panes);
  const isPanelOpen = narrow || layout.isPanelOpen;
  const is3dMade = useOnce(panes !== 'photo');
  const hasSam = useAsked(
    async (signal) => !isTraining && serverHasSam(subject.model, signal),
    [subject.model],
  );
  useEffect(() => {
    if (hasSam.value) session.setSamClicks('auto');
  }, [session, hasSam.value]);
  const renderingOf = (of: View) => pictureUrl(session.model, of.view);
  const thumbnailOf = (of: View) => pictures.thumbnailOf(of.view, thumbnailSide);
  const state = useStore(session.state);
  const { prompt, answer, ladder, miss, numAnswers } = state;
  const { selection, showing } = useStore(selections.state);
  const draft = useStore(drafting.state);
  const shown = view?.view ?? '';
  useEffect(() => {
    session.show(shown);
    finder.show(shown);
    things.show(shown);
    if (view) everything.show(shown, sizeOf(view));
  }, [model, shown]);
  useKeptPrompt(session);
  const found = useFound(finder, prompt === undefined);
  const named = useStore(labels.list);
  const shownThings = useThings(things, labels, prompt);
  const segmentNames = useSegmentNames(everything, things, labels);
  const tintedThings = useTintedThings(things, thingsIn3d, labels);
  const color = prompt && labelColor(named, prompt);

  const step = (by: number) => {
    const next =
      views[(views.findIndex((other) => other.view === shown) + by + views.length) % views.length];
    if (next) setView(next);
  };
  const sizeStep = (by: number) => {
    const next = (ladder.at ?? 0) + by;
    if (!ladder.isCurrent || next < 0 || next >= ladder.rungs.length) return;
    session.climb(next);
    session.rest();
  };
  /** Focuses a field of the panel, which opens. */
  const focusField = (id: string) => {
    layout.openPanel(true);
    requestAnimationFrame(() => document.getElementById(id)?.focus());
  };
  const addPointIn3d = (camera: FreeCamera, point: Point) => {
    const before = session.state.get().prompt;
    session.addPoint({ camera }, point);
    const { prompt: now } = session.state.get();
    promptIn3d.current = now === before ? undefined : now;
  };
  const takeBackIn3d = () => {
    const { prompt: now } = session.state.get();
    // A click that hit nothing took itself back.
    if (now && now === promptIn3d.current) void history.undo();
  };
  const show3d = () => {
    if (panes === 'photo') layout.show(narrow ? '3d' : 'both');
  };
  /** Chooses what a drag in 3D does, which is shown; a second time it turns the view again. */
  const dragIn3d = (drag: DragTool) => {
    show3d();
    setPicking({ ...picking, drag: picking.drag === drag ? 'turn' : drag });
  };
  const otherSide = () => {
    if (tool === 'brush') setBrush({ ...brush, negative: !brush.negative });
    else if (tool === 'paint' || tool === 'erase') setTool(tool === 'paint' ? 'erase' : 'paint');
  };
  const showEverything = (isOn: boolean) => {
    session.hover.leave();
    if (isOn) setTool('include');
    everything.turn(isOn);
  };
  /** Makes a segment the current one, to be named. */
  const pick = (picked: Prompt | undefined) => {
    if (!picked) return;
    session.pose(picked);
    if (!narrow) focusField('label-text');
  };
  const ofModels: Shortcuts = {
    '1': () => layout.show('photo'),
    '2': () => layout.show('both'),
    '3': () => layout.show('3d'),
    g: () => showEverything(!everything.state.get().isOn),
    n: () => things.turn(!things.state.get().isOn),
    a: () => hasSam.value === true && findAlike(session, finder),
    '/': () => focusField('find-text'),
    l: () => focusField('label-text'),
    s: () => selectWith(session, selections, 'select'),
    t: () => selections.show('tinted'),
    o: () => selections.show('isolated'),
    w: () => selections.show('hidden'),
    R: () => dragIn3d('box'),
    F: () => dragIn3d('lasso'),
    c: () => void edits.turnCrop(edits.state.get().edits.crop === undefined),
    m: () => setCameras(cameras === 'on' ? 'off' : 'on'),
    Delete: () => edits.hidePicked(),
  };
  /** While something is moved: as in other 3D programs. */
  const ofMoves: Shortcuts = {
    g: () => drafting.setMode('translate'),
    r: () => drafting.setMode('rotate'),
    s: () => drafting.setMode('scale'),
  };
  useShortcuts({
    ...(!isTraining && ofModels),
    '?': () => setHelp(true),
    'Ctrl+z': () => void history.undo(),
    'Ctrl+Z': () => void history.redo(),
    'Ctrl+y': () => void history.redo(),
    Escape: () => {
      if (draft) return drafting.end();
      if (picking.drag !== 'turn') return setPicking({ ...picking, drag: 'turn' });
      if (!session.state.get().prompt) everything.turn(false);
      session.clear();
    },
    p: () => layout.openPanel(!layout.isPanelOpen),
    '[': () => step(-1),
    ']': () => step(1),
    ',': () => sizeStep(-1),
    '.': () => sizeStep(1),
    i: () => setTool('include'),
    e: () => setTool('exclude'),
    r: () => setTool('box'),
    d: () => setTool('brush'),
    f: () => setTool('lasso'),
    j: () => setTool('paint'),
    k: () => setTool('erase'),
    x: otherSide,
    '>': () => isWide(tool) && setBrush(withWidth(brush, brush.width + 2)),
    '<': () => isWide(tool) && setBrush(withWidth(brush, brush.width - 2)),
    u: () => session.hover.turn(!session.hover.state.get().isOn),
    v: () => setSource(source === 'photo' ? 'rendering' : 'photo'),
    ...(draft?.kind === 'move' && ofMoves),
  });
  if (!view) return <p class="loading">The model has no views.</p>;

  const { width, height } = sizeOf(view);
  const place = { view: shown };
  const here = samePlace(placeOf(prompt), place) ? prompt : undefined;
  return (
    <>
      {pictures.isEdited && <Advice about={`${subject.scene}/edits`} text={editedAdvice} />}
      <div
        class={`workbench ${isPanelOpen ? '' : 'folded'} ${draft ? 'drafting' : ''}`}
        data-model={subject.model}
        style={{ '--ratio': `${width / height}` }}
      >
        <div class="panes">
          <div class="pane-grid">
            <div class="pane" hidden={panes === '3d'}>
              <PhotoView
                view={view}
                photoAt={(maxSide) => photoUrl(subject.photos, { name: shown, maxSide })}
                rendering={renderingOf(view)}
                source={source}
                onSource={setSource}
                mask={answer?.masks.get(shown)}
                color={color}
                found={found.masks}
                things={shownThings}
                prompt={here}
                miss={samePlace(miss?.place, place) ? miss : undefined}
                tool={tool}
                brush={brush}
                hover={session.hover}
                everything={everything}
                segmentNames={segmentNames}
                numAnswers={numAnswers}
                onPoint={(point) =>
                  everything.state.get().isOn
                    ? pick(everything.promptAt(point.x, point.y))
                    : session.addPoint(place, point)
                }
                onBox={(box) => session.pose({ kind: 'box', place, box })}
                onStroke={(stroke) => drawWith(tool, session, shown, sizeOf(view), stroke)}
              />
            </div>
            <div class="pane" hidden={panes === 'photo'}>
              {is3dMade && (
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
                  things={tintedThings}
                  edits={edits}
                  drafting={drafting}
                  picking={picking}
                  onPicking={setPicking}
                  cameras={{
                    areShown: cameras === 'on',
                    onShow: (areShown) => setCameras(areShown ? 'on' : 'off'),
                    onView: setView,
                    photoOf: thumbnailOf,
                  }}
                  onPoint={addPointIn3d}
                  onApply={() => void applyDraft(model)}
                  onTakeBack={takeBackIn3d}
                />
              )}
            </div>
          </div>
          {!isPanelOpen && <FoldedStatus {...model} shown={shown} />}
        </div>
        <Filmstrip
          views={views}
          current={shown}
          masks={answer?.masks}
          color={color}
          found={found.boxes}
          photoOf={thumbnailOf}
          renderingOf={renderingOf}
          onPick={setView}
        />
        <ToolPanel
          sceneId={sceneIdOf(subject.scene)}
          isTraining={isTraining}
          {...model}
          {...{ views, view, tool, brush, segmentNames }}
          onTool={setTool}
          onBrush={setBrush}
          onEverything={showEverything}
          onPick={(id) => pick(everything.promptOf(id))}
          hasSam={hasSam.value === true}
          isOpen={isPanelOpen}
          photoOf={thumbnailOf}
          onShow3d={show3d}
          onHelp={() => setHelp(true)}
        />
        {help && <ShortcutList onClose={() => setHelp(false)} />}
      </div>
    </>
  );
}
