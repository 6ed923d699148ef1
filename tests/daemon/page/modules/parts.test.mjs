// The pure modules: events out of text, ways between poses, ticks, clouds.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const page = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page');
const { EventReader } = await import(join(page, 'state', 'sse.js'));
const { alongAxis, wayInSteps, wayToGo, stepsTo, compose, turn } = await import(join(page, 'parts', 'pose.js'));
const { enlargement, halfAxes, pointCovariance } = await import(join(page, 'parts', 'ellipsoid.js'));
const { ticks, logTicks } = await import(join(page, 'parts', 'ticks.js'));
const { joinParts, joinSurfaces, deviationEnd, boxAround, finerVoxel, boundsOf, pickPoint, MAX_POINTS, shareOf, shareOfParts } = await import(join(page, 'scene', 'cloud_data.js'));

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

test('the steps to go are turns about the axes of the flange one after the other, and shrink while the arm is jogged', () => {
  const about = (axis, deg) => ({ translation_mm: [0, 0, 0], quaternion_wxyz: [Math.cos(deg * Math.PI / 360), ...[0, 1, 2].map((one) => (one === axis ? Math.sin(deg * Math.PI / 360) : 0))] });
  const here = { translation_mm: [500, 0, 700], quaternion_wxyz: [HALF, 0, HALF, 0] };
  const turned = compose(here, about(0, -40));
  const there = { ...compose(turned, about(2, 30)), translation_mm: [520, 0, 650] };
  const shift = { shift_mm: [20, 0, -50] };
  assert.deepEqual(stepsTo(here, there), [{ turn_axis: 'x', deg: -40 }, { turn_axis: 'z', deg: 30 }, shift]);
  assert.deepEqual(stepsTo(turned, there), [{ turn_axis: 'z', deg: 30 }, shift]);
  assert.deepEqual(stepsTo(there, there), []);
});

test('one move along each axis in order, and nothing is left', () => {
  const here = { translation_mm: [500, 0, 700], quaternion_wxyz: [HALF, 0, HALF, 0] };
  const there = { translation_mm: [520, -30, 650], quaternion_wxyz: [0.5, -0.5, 0.1, Math.sqrt(0.49)] };
  const left = (at) => { const { turns_deg, shifts_mm } = wayInSteps(at, there); return [...turns_deg, ...shifts_mm]; };
  let at = here;
  for (let bar = 0; bar < 6; bar += 1) {
    const before = left(at);
    at = alongAxis(at, bar < 3 ? 'turn' : 'shift', bar % 3, before[bar]);
    near(left(at), before.map((value, index) => (index <= bar ? 0 : value)), 1e-6);
  }
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

test('the first look at a cloud fetches at most 12 MB, however many views it has', () => {
  for (const views of [1, 7, 24, 1000]) {
    const points = views * (shareOf(MAX_POINTS.first, views) + shareOf(MAX_POINTS.finer, views));
    assert.ok(12 * points <= 12e6, `${views} views`);
  }
});

test('the ellipsoid of a point: a turn moves it across the sight, a shift everywhere', () => {
  const diagonal = (values) => values.map((value, at) => values.map((_, column) => (column === at ? value : 0)));
  const covariance = pointCovariance(diagonal([1e-6, 4e-6, 9e-6, 0.01, 0.01, 0.01]), [0, 0, 500]);
  near(covariance.flat(), [4e-6 * 250000 + 0.01, 0, 0, 0, 1e-6 * 250000 + 0.01, 0, 0, 0, 0.01]);
  const axes = halfAxes(covariance);
  near(axes.map(({ length_mm }) => length_mm), [2 * Math.sqrt(1.01), 2 * Math.sqrt(0.26), 0.2]);
  near(axes[2].direction.map(Math.abs), [0, 0, 1]);
});

test('half axes of a turned ellipsoid', () => {
  const [c, s] = [Math.cos(0.7), Math.sin(0.7)];
  const axes = halfAxes([[9 * c * c + s * s, 8 * c * s, 0], [8 * c * s, 9 * s * s + c * c, 0], [0, 0, 4]], 1);
  near(axes.map(({ length_mm }) => length_mm), [3, 2, 1]);
  near(axes[0].direction.map((value) => value * Math.sign(axes[0].direction[0])), [c, s, 0]);
  near([enlargement(0.2, 60), enlargement(3, 3), enlargement(0, 5)], [200, 1, 1]);
});

test('surfaces are joined with their deviations and normals', () => {
  const cloud = joinSurfaces([{ view: 0, records: new Float32Array([1, 2, 3, 0.5, 0, 0, 1]) }, { view: 2, records: new Float32Array([4, 5, 6, NaN, 0, 1, 0]) }]);
  assert.deepEqual([cloud.points, [...cloud.xyz], [...cloud.view], [...cloud.deviation], [...cloud.normal]], [2, [1, 2, 3, 4, 5, 6], [0, 2], [0.5, NaN], [0, 0, 1, 0, 1, 0]]);
});

test('the scale of deviations is round and holds nine of ten', () => {
  const deviations = Float32Array.from({ length: 100 }, (_, index) => (index === 0 ? -40 : (index - 50) / 1000));
  assert.deepEqual([deviationEnd(deviations), deviationEnd(new Float32Array([NaN]))], [0.05, null]);
  assert.equal(boxAround([1, 2, -3], 1.5), '-0.50,0.50,-4.50,2.50,3.50,-1.50');
});

test('a cloud is as far as its views are fetched, and the one on its way by an event that came since', () => {
  const before = { scan_id: 's', work: 'merge', view: 1, progress: 0.9 };
  const part = { index: 1, of: 4, view: 1, work: 'merge', before };
  const of = (event) => shareOfParts(part, 's', event);
  assert.deepEqual([of(undefined), of(before)], [0.25, 0.25]);
  assert.equal(of({ ...before, progress: 0.5 }), 0.375);
  for (const other of [{ scan_id: 'x' }, { view: 0 }, { view: null }, { work: 'surface' }]) assert.equal(of({ ...before, progress: 0.5, ...other }), 0.25);
});
