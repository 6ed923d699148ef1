// Which sentence of the cell holds.
import assert from 'node:assert/strict';
import test from 'node:test';
import { endedEarly, lastSeenAt, standingOf } from '../../../../daemon/page/parts/standing.js';

const ready = { ready: true };
const steady = { standing: 'steady' };
const target = { corners: [[0, 10, 10]] };
const wall = { corners: [] };
const ended = { kind: 'calibration', state: 'aborted' };

for (const [now, expected] of [
  [{ running: true, ready, drift: steady, ended, seen: wall }, 'running'],
  [{ ready: { ready: false }, drift: steady, ended, seen: wall }, 'not-ready'],
  [{ ready, drift: steady, ended, seen: wall }, 'away'],
  [{ ready, drift: steady, ended, seen: { corners: null } }, 'away'],
  [{ ready, none: true, ended, seen: wall }, 'none-away'],
  [{ ready, drift: steady, ended, seen: null }, 'looking'],
  [{ ready, none: true, ended, seen: null }, 'looking'],
  [{ ready, drift: steady, ended, seen: target }, 'good'],
  [{ ready, none: true, ended, seen: target }, 'none'],
  [{ ready, drift: steady, ended: null, seen: wall }, 'good'],
  [{ ready, drift: { standing: 'drifting' }, ended: null, seen: wall }, 'moved'],
  [{ ready, drift: { standing: 'learning' }, ended: null, seen: null }, 'unchecked'],
]) {
  test(`the cell is "${expected}" for ${JSON.stringify(now)}`, () => assert.equal(standingOf(now), expected));
}

test('the last run that looked at the target decides; small moves after it do not', () => {
  const run = (kind, state) => ({ kind, state });
  for (const state of ['aborted', 'failed']) {
    assert.equal(endedEarly([run('jog', 'finished'), run('jog', 'aborted'), run('verify', state)])?.state, state);
  }
  for (const runs of [undefined, [], [run('calibration', 'finished'), run('verify', 'failed')], [run('scan', 'aborted')], [run('jog', 'failed')]]) {
    assert.equal(endedEarly(runs), null);
  }
});

test('the way back leads to the last picture with the target in it, else to where the run began', () => {
  const view = (base_T_flange, corners, status = 'taken') => ({ base_T_flange, corners, status });
  assert.equal(lastSeenAt([view('a', [[1]]), view('b', [[1]]), view('c', [], 'missed')]), 'b');
  assert.equal(lastSeenAt([view('a', []), view('b', [])]), 'a');
  for (const views of [undefined, [], [view('a', [], 'missed')]]) assert.equal(lastSeenAt(views), null);
});
