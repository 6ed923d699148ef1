// The time a run has left, by the pace of its pictures: known from the second on, near the truth, and hardly ever longer than before. The picture at which it is.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const { picturesOf, timesOf } = await import(join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page', 'parts', 'run_times.js'));

const PICTURES = 8;
const BEGAN_S = 1.7e9;
const at = (s) => new Date(1000 * (BEGAN_S + s)).toISOString();

/** Numbers from 0 to 1, the same in each run (a multiplicative congruential generator). */
function* randoms(seed) {
  for (let state = seed; ; ) yield (state = (state * 48271) % 2147483647) / 2147483647;
}

/** When each picture of a run was taken, s: each takes 0.75 to 1.25 times the usual time; and when the run ended, after solving. */
function aRun(seed) {
  const random = randoms(seed);
  const each_s = 3 + 12 * random.next().value;
  const taken_s = [];
  for (let now_s = 4; taken_s.length < PICTURES; ) taken_s.push((now_s += each_s * (0.75 + 0.5 * random.next().value)));
  return { taken_s, end_s: taken_s.at(-1) + 1.5 };
}

const shownAfter = ({ taken_s }, count) => ({
  created_at: at(0), updated_at: at(taken_s[count - 1] ?? 0), stations: PICTURES,
  planning: { history: taken_s.slice(0, count).map((s, index) => ({ station: index + 1, at: at(s) })) },
});

test('in 20 runs of 8 the time left at half-way is right within 25 % and 3 s, and rises by 30 % at most', () => {
  for (let seed = 1; seed <= 20; seed += 1) {
    const run = aRun(seed * 7919);
    const half = timesOf(shownAfter(run, PICTURES / 2), 0).left_s;
    const true_s = run.end_s - run.taken_s[PICTURES / 2 - 1];
    assert.ok(Math.abs(half - true_s) <= 0.25 * true_s + 3, `${seed}: ${half} of ${true_s}`);
    for (let count = 3; count <= PICTURES; count += 1) {
      const before = timesOf(shownAfter(run, count - 1), run.taken_s[count - 1] - run.taken_s[count - 2]).left_s;
      const after = timesOf(shownAfter(run, count), 0).left_s;
      assert.ok(after <= 1.3 * before + 3, `${seed}: ${before} to ${after}`);
    }
  }
});

test('the seconds since the beginning go on before the first picture, and what is left is told from the second', () => {
  const run = aRun(1);
  for (const since_s of [0, 1, 2]) assert.deepEqual(timesOf(shownAfter(run, 0), since_s), { elapsed_s: since_s, left_s: null });
  assert.equal(timesOf(shownAfter(run, 1), 0).left_s, null);
  const { elapsed_s, left_s } = timesOf(shownAfter(run, 2), 0);
  assert.ok(Math.abs(elapsed_s - run.taken_s[1]) < 0.01 && left_s > 0);
  assert.ok(Math.abs(timesOf(shownAfter(run, 2), 1).left_s - (left_s - 1)) < 1e-6);
});

test('the picture at which a run is has the number that its film shows', () => {
  const links = (stored) => Object.fromEntries(Array.from({ length: stored }, (_, index) => [`frame ${index}`, `/runs/1/frames/${index}`]));
  const rows = [ // [run, pictures stored], { taken, of, number }
    [{ station: 2, stations: 5, state: 'moving', planning: null }, 2, { taken: 2, of: 5, number: 3 }],
    [{ station: 5, stations: 5, state: 'solving', planning: null }, 5, { taken: 5, of: 5, number: 5 }],
    [{ station: 0, stations: 5, state: 'moving', planning: {} }, 1, { taken: 1, of: 6, number: 2 }], // after the first look
    [{ station: 2, stations: 5, state: 'waiting', planning: {}, request: { manual: true } }, 3, { taken: 3, of: 6, number: 4 }], // one was refused
    [{ station: 2, stations: 5, state: 'planning', planning: {}, request: { manual: true } }, 3, { taken: 2, of: 5, number: 3 }], // the third is looked at
  ];
  for (const [run, stored, expected] of rows) assert.deepEqual(picturesOf({ ...run, links: links(stored) }), expected);
});
