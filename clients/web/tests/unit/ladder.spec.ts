import { create } from '@bufbuild/protobuf';
import { expect, test } from '@playwright/test';
import { ProposeScalesResponseSchema } from '../../gen/pepeseg/v1/segmentation_service_pb';
import type { Proposal } from '../../app/scene/answer';
import { proposalsOf } from '../../app/scene/answer';
import { describeRung, ladderOf, noLadder } from '../../app/scene/ladder';
import { firstColumns } from './runs';

function maskOf(columns: number) {
  return { view: 'a.jpg', rle: firstColumns(columns), area: columns * 10, score: 1, box: [] };
}

function proposed(columns: number, best = false): Proposal {
  return { scale: columns / 100, threshold: 0.7, best, mask: maskOf(columns) };
}

function answered(columns: number, granularity = {}) {
  return { granularity, scale: 0.33, threshold: 0.6, mask: maskOf(columns) };
}

test('proposals are the server’s, in its order', () => {
  const proposal = (scaleQuantile: number) => ({
    scaleQuantile,
    threshold: 0.7,
    mask: { area: 40n, mask: { case: 'rle', value: firstColumns(4) } as const },
  });
  const response = { proposals: [proposal(0.1), proposal(0.4)], best: 1 };
  const shown = proposalsOf(create(ProposeScalesResponseSchema, response));
  expect(shown.map(({ scale, best, mask: { area } }) => [scale, best, area])).toEqual([
    [0.1, false, 40],
    [0.4, true, 40],
  ]);
});

test('the sizes are ordered by area, with the answer among them', () => {
  const ladder = ladderOf([proposed(60), proposed(10), proposed(30, true)], answered(20));
  expect(ladder.rungs.map(({ mask }) => mask.area)).toEqual([100, 200, 300, 600]);
  expect([ladder.at, ladder.guess, ladder.isCurrent]).toEqual([1, 1, true]);
  expect(ladder.rungs[1]?.granularity).toEqual({}); // the server chooses again
  expect(ladder.rungs[3]?.granularity).toEqual({ scale: 0.6, threshold: 0.7 });
});

test('of two neighbours with nearly the same mask one is shown', () => {
  const ladder = ladderOf([proposed(20), proposed(50), proposed(52), proposed(60)], undefined);
  expect(ladder.rungs.map(({ mask }) => mask.area)).toEqual([200, 500, 600]);
  // The server's guess stays, and the answer before that.
  const guess = ladderOf([proposed(50), proposed(52, true), proposed(90)], undefined);
  expect(guess.rungs.map(({ mask }) => mask.area)).toEqual([520, 900]);
  const own = ladderOf([proposed(50), proposed(52, true), proposed(90)], answered(51));
  expect(own.rungs.map(({ mask }) => mask.area)).toEqual([510, 900]);
  expect([own.at, own.guess]).toEqual([0, 0]);
});

test('the label says which size is shown, and how it is to the best guess', () => {
  const proposals = [proposed(10), proposed(30, true), proposed(60), proposed(90)];
  const chosen = { scale: 0.6, threshold: 0.7 };
  const ladder = ladderOf(proposals, answered(60, chosen));
  expect(describeRung(ladder)).toBe('3 of 4, larger');
  expect(describeRung({ ...ladder, at: 1 })).toBe('2 of 4, best guess');
  expect(describeRung({ ...ladder, at: 0 })).toBe('1 of 4, smaller');
  expect(describeRung(noLadder)).toBe('');
  expect(describeRung(ladderOf([], answered(60)))).toBe('the only size');
  // The guess was merged into the answer that was chosen.
  const merged = ladderOf([proposed(10), proposed(30, true)], answered(30, chosen));
  expect([merged.at, merged.guess]).toEqual([1, 1]);
});

test('an empty answer is no size', () => {
  expect(ladderOf([], answered(0)).rungs).toEqual([]);
});
