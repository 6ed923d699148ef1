// The pure modules: events out of text, ways between poses, ticks, clouds.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const page = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page');
const { EventReader } = await import(join(page, 'state', 'sse.js'));
const { wayToGo, compose, turn } = await import(join(page, 'parts', 'pose.js'));
const { ticks, logTicks } = await import(join(page, 'parts', 'ticks.js'));
const { joinParts, finerVoxel, boundsOf, pickPoint } = await import(join(page, 'scene', 'cloud_data.js'));

const near = (found, expected, off = 1e-9) => found.forEach((value, index) => assert.ok(Math.abs(value - expected[index]) < off, `${found}`));
const HALF = Math.SQRT1_2;

test('events are whole however the text is cut', () => {
  const text = ': hello\n\nid: 7\nevent: run\ndata: {"a": 1}\n\nevent: live\r\ndata: {}\r\n\r\n';
  for (const size of [1, 5, 200]) {
    const reader = new EventReader();
    const found = [];
    for (let at = 0; at < text.length; at += size) found.push(...reader.take(text.slice(at, at + size)));
    assert.deepEqual(found.filter(({ kind }) => kind).map(({ kind, id, data }) => [kind, id, data]), [['run', '7', { a: 1 }], ['live', '', {}]]);
  }
});

test('the way to go is in the flange for turns and in the base for shifts', () => {
  const here = { translation_mm: [1, 2, 3], quaternion_wxyz: [HALF, 0, 0, HALF] };
  const there = compose(here, { translation_mm: [0, 0, 0], quaternion_wxyz: [Math.cos(Math.PI / 6), 0, Math.sin(Math.PI / 6), 0] });
  const { turns_deg, shifts_mm } = wayToGo(here, { ...there, translation_mm: [11, 2, -7] });
  near(turns_deg, [0, 60, 0]);
  near(shifts_mm, [10, 0, -10]);
});

test('a quaternion and its negative are the same way', () => {
  const here = { translation_mm: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0] };
  near(wayToGo(here, { translation_mm: [0, 0, 0], quaternion_wxyz: [-HALF, -HALF, 0, 0] }).turns_deg, [90, 0, 0]);
  near(turn([HALF, 0, 0, HALF], [1, 0, 0]), [0, 1, 0]);
});

test('ticks are round', () => {
  assert.deepEqual(ticks(0, 1, 5), [0, 0.2, 0.4, 0.6, 0.8, 1]);
  assert.deepEqual(ticks(0, 3, 8, true), [0, 1, 2, 3]);
  assert.deepEqual(logTicks(0.05, 3), [0.05, 0.1, 0.2, 0.5, 1, 2]);
});

test('a cloud keeps the view of each point, its bounds, and the point that was pressed', () => {
  const { xyz, view, points } = joinParts([{ view: 2, xyz: new Float32Array([0, 0, 0, 1, 1, 1]) }, { view: 5, xyz: new Float32Array([0, 0, -4]) }]);
  assert.equal(points, 3);
  assert.deepEqual([...view], [2, 2, 5]);
  assert.deepEqual(boundsOf(xyz), [[0, 0, -4], [1, 1, 1]]);
  assert.equal(pickPoint(xyz, [0, 0, 10], [0, 0, -1], 0.01), 0);
  assert.equal(pickPoint(xyz, [9, 9, 9], [0, 0, -1], 0.01), -1);
});

test('finer cubes spend the budget', () => {
  assert.equal(finerVoxel(8, 43750, 700000), 2);
  assert.equal(finerVoxel(8, 10, 700000), 0.3);
});
