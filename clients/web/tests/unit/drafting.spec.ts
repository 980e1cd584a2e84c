// Edits that are shown in 3D before they are made.
import { expect, test } from '@playwright/test';
import { Euler, MathUtils, Quaternion, Vector3 } from 'three';
import { Drafting, colorOfText, editOf, luminanceOfSet } from '../../app/edit/drafting';
import { middleOfSet, moves, noMove, rotationOf } from '../../app/edit/move';
import type { GaussianEdits, GaussianState } from '../../app/gaussians/gaussian_edits';
import { Store } from '../../app/store';

const gaussians = {
  count: 3,
  centers: Float32Array.of(0, 0, 0, 2, 4, -6, 1, 1, 50),
  sizes: new Float32Array(3),
  opacities: Float32Array.of(0.5, 1, 1),
  luminances: Float32Array.of(0.8, 0.2, 1),
};
const picked = Uint8Array.of(1, 1, 0);

function editsWith(set: Uint8Array) {
  const edits = { picked: set, hidden: new Uint8Array(3), isAlone: false, crop: undefined };
  const state = { gaussians, numPicked: set.filter(Boolean).length, edits };
  return { state: new Store(state as unknown as GaussianState) } as unknown as GaussianEdits;
}

test('angles give the rotation that three.js makes of them', () => {
  for (const angles of [[0, 0, 0], [90, 0, 0], [10, -70, 130], [-175, 20, 89]] as const) {
    const [x, y, z] = angles.map(MathUtils.degToRad) as [number, number, number];
    const { x: ex, y: ey, z: ez, w } = new Quaternion().setFromEuler(new Euler(x, y, z, 'XYZ'));
    const found = rotationOf(angles);
    for (const [a, b] of [[found.x, ex], [found.y, ey], [found.z, ez], [found.w, w]]) {
      expect(a).toBeCloseTo(b as number, 12);
    }
  }
  const { x, y, z, w } = rotationOf([0, 0, 90]);
  const turned = new Vector3(1, 0, 0).applyQuaternion(new Quaternion(x, y, z, w));
  expect(turned.distanceTo(new Vector3(0, 1, 0))).toBeLessThan(1e-12);
});

test('the pivot is the middle of the box of what is picked', () => {
  expect(middleOfSet(picked, gaussians.centers)).toEqual([1, 2, -3]);
  expect(middleOfSet(new Uint8Array(3), gaussians.centers)).toEqual([0, 0, 0]);
});

test('the luminance of a set counts opaque Gaussians more', () => {
  expect(luminanceOfSet(picked, gaussians)).toBeCloseTo((0.5 * 0.8 + 0.2) / 1.5, 6);
  expect(luminanceOfSet(new Uint8Array(3), gaussians), 'never 0').toBe(0.02);
});

test('a move is sent with its pivot once it moves something', () => {
  const drafting = new Drafting(editsWith(picked));
  drafting.begin('move');
  const begun = drafting.state.get();
  expect(begun).toMatchObject({ kind: 'move', copy: false, mode: 'translate', pivot: [1, 2, -3] });
  expect(begun && editOf(begun), 'nothing moves yet').toBeUndefined();
  expect(moves(noMove)).toBe(false);
  drafting.moveTo({ translation: [0, 0, 2] });
  drafting.moveTo({ rotation: [0, 0, 180], scale: 5000 });
  const draft = drafting.state.get();
  const edit = draft && editOf(draft);
  if (edit?.case !== 'move') throw new Error('not a move');
  expect(edit.value).toMatchObject({
    translation: { x: 0, y: 0, z: 2 },
    pivot: { x: 1, y: 2, z: -3 },
    scale: 1000,
    copy: false,
  });
  expect(edit.value.rotation?.z).toBeCloseTo(1, 12);
  expect(edit.value.rotation?.w).toBeCloseTo(0, 12);
});

test('a copy and another colour are drafts, too', () => {
  const drafting = new Drafting(editsWith(picked));
  drafting.begin('copy');
  drafting.moveTo({ scale: 2 });
  const copy = drafting.state.get();
  expect(copy && editOf(copy)).toMatchObject({ case: 'move', value: { copy: true, scale: 2 } });
  drafting.begin('recolor');
  drafting.recolor({ color: '#ff8000', strength: 0.5 });
  const recolor = drafting.state.get();
  expect(recolor && editOf(recolor)).toEqual({
    case: 'recolor',
    value: { red: 1, green: 128 / 255, blue: 0, strength: 0.5 },
  });
  expect(colorOfText('#0033ff')).toEqual([0, 0.2, 1]);
});

test('other picks end a draft, and without picks none begins', () => {
  const edits = editsWith(picked);
  const drafting = new Drafting(edits);
  drafting.begin('move');
  edits.state.patch({ searching: true });
  expect(drafting.state.get()?.kind).toBe('move');
  edits.state.patch({ edits: { ...edits.state.get().edits, picked: Uint8Array.of(1, 0, 0) } });
  expect(drafting.state.get()).toBeUndefined();
  const nothing = new Drafting(editsWith(new Uint8Array(3)));
  nothing.begin('move');
  expect(nothing.state.get()).toBeUndefined();
});
