// What is drawn without WebGL 2: places in the three pictures, and colours of points as the shader gives them.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const scene = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page', 'scene');
const { projectionsOf, SIDES } = await import(join(scene, 'flat_view.js'));
const { shadeOf } = await import(join(scene, 'cloud.js'));

const { inOrder, movedApart, APART_PX } = await import(join(scene, 'numbers.js'));
const { markOf } = await import(join(scene, 'cell.js'));
const { isDrawable } = await import(join(scene, 'arm_body.js'));

const near = (found, expected, off = 1e-9) => expected.forEach((value, index) => assert.ok(Math.abs(value - found[index]) < off, `${found} is not ${expected}`));

test('a box stands in the middle of each third, at one scale, with z or y upwards', () => {
  const [front, above, side] = projectionsOf([[-100, -50, 0], [100, 50, 300]], 900, 300);
  for (const [index, project] of [front, above, side].entries()) near(project([0, 0, 150]), [150 + 300 * index, 150]);
  const mm = 0.8; // 300 mm fill 80 % of 300 pixels, and 200 mm less than that of 300 across
  near(front([100, 0, 300]), [150 + 100 * mm, 150 - 150 * mm]);
  near(above([100, 50, 0]), [450 + 100 * mm, 150 - 50 * mm]);
  near(side([0, 50, 0]), [750 + 50 * mm, 150 + 150 * mm]);
});

test('a wide box is held by the width of its third, and one without extent by nothing', () => {
  const [front] = projectionsOf([[-1000, 0, 0], [1000, 1, 1]], 900, 300);
  near(front([1000, 0, 0.5]), [150 + 0.8 * 150, 150]);
  const [point] = projectionsOf([[5, 5, 5], [5, 5, 5]], 900, 300);
  near(point([5, 5, 5]), [150, 150]);
});

test('what is nearer to the eye has more of its sign along the axis of sight', () => {
  assert.deepEqual(SIDES.map(({ along, sign }) => [along, sign]), [[1, -1], [2, 1], [0, 1]]);
});

const values = (...numbers) => ({ getX: (index) => numbers[index][0], getY: (index) => numbers[index][1], getZ: (index) => numbers[index][2] });
const uniforms = (colouring) => ({ colouring: { value: colouring }, low: { value: 0 }, high: { value: 100 }, cut: { value: 90 }, span: { value: 0.5 } });
const attributes = {
  position: values([0, 0, 0], [0, 0, 50], [0, 0, 91], [0, 0, 90]),
  view: values([0], [1], [2], [3]),
  deviation: values([-0.5], [0], [0.25], [1e9]),
  facing: values([0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, -1]),
};

test('points above the cut have no colour, those at it have', () => {
  for (const colouring of [0, 1, 2, 3]) {
    assert.equal(shadeOf(uniforms(colouring), attributes, 2), null);
    assert.equal(shadeOf(uniforms(colouring), attributes, 3).length, 3);
  }
});

test('colours are those of the shader', () => {
  const shades = (colouring, ...which) => which.map((index) => shadeOf(uniforms(colouring), attributes, index));
  near(shades(2, 0, 1, 3).flat(), [20.4, 76.5, 165.75, 237.15, 237.15, 237.15, 140.25, 140.25, 140.25], 1); // blue end, none, not known
  assert.deepEqual(shades(3, 0, 1), [[128, 128, 255], [255, 128, 128]]);
  assert.deepEqual(shades(1, 0)[0], [41, 56, 122]); // the low end of the ramp
  const [first, second] = shades(0, 0, 1);
  near(first, [0.92 * 255 * (0.62 + 0.62 * 0.38), 0.92 * 255 * 0.38 * 0.62, 0.92 * 255 * 0.38 * 0.62], 1); // red
  assert.notDeepEqual(first, second);
});

test('pictures are numbered in their order: taken, the next, planned', () => {
  const at = (...translation_mm) => ({ translation_mm });
  const order = inOrder({ taken: [at(1, 0, 0), at(2, 0, 0)], next: at(3, 0, 0), planned: [at(4, 0, 0)] });
  assert.deepEqual(order.map(({ state, at: [x] }) => [state, x]), [['taken', 1], ['taken', 2], ['next', 3], ['planned', 4]]);
  assert.deepEqual(inOrder({}), []);
});

test('no two numbers are too near to be read, however near their pictures are', () => {
  const crowds = [[[5, 5], [5, 5]], [[0, 0], [1, 0], [0, 1], [200, 0]], Array.from({ length: 12 }, (_, k) => [3 * k, (k % 3) * 2])];
  for (const spots of crowds) {
    const moved = movedApart(spots);
    moved.forEach(([x, y], i) => moved.slice(0, i).forEach(([u, v]) => assert.ok(Math.hypot(x - u, y - v) >= 22, `${i}: ${moved}`)));
  }
  assert.deepEqual(movedApart([[0, 0], [APART_PX, 0]]), [[0, 0], [APART_PX, 0]]);
});

test('an arm is drawn by its links when it has six axes and its wrist is not offset', () => {
  const rows = [[[150, 486.5, 700, 0, 600, 65, 0], true], [[0, 265, 444, 110, 470, 101, 80], false], [null, false], [undefined, false]];
  for (const [lengths_mm, drawn] of rows) assert.equal(isDrawable(lengths_mm), drawn);
});

test('before the first calibration a view is marked by its flange: no camera and no target is drawn', () => {
  const pose = { translation_mm: [1, 2, 3], quaternion_wxyz: [1, 0, 0, 0] };
  const extent = (about) => {
    const corners = [];
    markOf(pose, { colour: 0 }, { outline_mm: [[0, 0, 0], [220, 160, 0]], ...about }).traverse(({ geometry }) => geometry && corners.push(...geometry.getAttribute('position').array));
    return [0, 1, 2].map((axis) => Math.max(...corners.filter((_, index) => index % 3 === axis)));
  };
  for (const carried of ['camera', 'target']) assert.deepEqual(extent({ known: false, carried }), [40, 40, 0]);
  near(extent({ known: true, carried: 'camera' }), [130 * 0.45, 130 * 0.3, 130], 1e-4);
  assert.deepEqual(extent({ known: true, carried: 'target' }), [235, 175, 0]);
});
