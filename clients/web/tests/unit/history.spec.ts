// Undo and redo.
import { expect, test } from '@playwright/test';
import type { Change } from '../../app/history';
import { History, changeOf } from '../../app/history';

/** Returns a history, and a value that its changes set. */
function withValue() {
  const history = new History();
  let value = 0;
  const set = (to: number): Change => {
    const change = changeOf(`to ${to}`, value, to, (put) => (value = put));
    value = to;
    history.add(change);
    return change;
  };
  return { history, set, value: () => value };
}

test('changes are undone from the newest on, and done again', async () => {
  const { history, set, value } = withValue();
  expect(history.state.get()).toMatchObject({ undo: undefined, redo: undefined });
  set(1);
  set(2);
  await history.undo();
  expect(value()).toBe(1);
  expect(history.state.get()).toMatchObject({ undo: 'to 1', redo: 'to 2' });
  await history.undo();
  await history.undo();
  expect(value()).toBe(0);
  await history.redo();
  await history.redo();
  await history.redo();
  expect([value(), history.state.get().redo]).toEqual([2, undefined]);
});

test('after another change, what was undone cannot be done again', async () => {
  const { history, set, value } = withValue();
  set(1);
  await history.undo();
  set(5);
  await history.redo();
  expect(value()).toBe(5);
  expect(history.state.get()).toMatchObject({ undo: 'to 5', redo: undefined });
});

test('a change that did nothing is dropped', () => {
  const { history, set } = withValue();
  const first = set(1);
  const second = set(2);
  expect([history.isNewest(first), history.isNewest(second)]).toEqual([false, true]);
  history.drop(second);
  expect([history.isNewest(first), history.state.get().undo]).toEqual([true, 'to 1']);
});

test('two changes become one, where the first was', async () => {
  const { history, set } = withValue();
  const log: string[] = [];
  const logged = (name: string): Change => ({
    name,
    undo: () => void log.push(`undo ${name}`),
    redo: async () => void log.push(`redo ${name}`),
  });
  const first = logged('first');
  history.add(first);
  set(1);
  history.join(first, logged('second'));
  await history.undo();
  await history.undo();
  await history.redo();
  expect(log).toEqual(['undo second', 'undo first', 'redo first', 'redo second']);
  expect(history.state.get()).toMatchObject({ undo: 'second', redo: 'to 1' });
  history.join(undefined, logged('third'));
  expect(history.state.get().undo).toBe('third');
});

test('a change that the server does not undo stays, and the failure is shown', async () => {
  const history = new History();
  let refuses = true;
  const undo = async () => {
    if (refuses) throw new Error('no');
  };
  history.add({ name: 'Name', undo, redo: () => undefined });
  await history.undo();
  expect(history.state.get()).toMatchObject({ undo: 'Name', redo: undefined, busy: false });
  expect(history.state.get().failure?.what).toBe('No.');
  refuses = false;
  await history.undo();
  expect(history.state.get()).toMatchObject({ undo: undefined, redo: 'Name', failure: undefined });
});

test('while the server undoes a change, no other is undone', async () => {
  const { history, set, value } = withValue();
  set(1);
  let done: () => void = () => undefined;
  const wait = new Promise<void>((resolve) => (done = resolve));
  history.add({ name: 'Name', undo: () => wait, redo: () => undefined });
  const first = history.undo();
  expect(history.state.get().busy).toBe(true);
  await history.undo();
  expect(value()).toBe(1);
  done();
  await first;
  expect(history.state.get()).toMatchObject({ undo: 'to 1', redo: 'Name', busy: false });
});

test('the oldest of more than fifty changes are forgotten', async () => {
  const { history, set, value } = withValue();
  for (let i = 1; i <= 60; ++i) set(i);
  while (history.state.get().undo) await history.undo();
  expect(value()).toBe(10);
});
