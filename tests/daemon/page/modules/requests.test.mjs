// What the page asks for by a jog, a touch and a calibration.
import assert from 'node:assert/strict';
import test from 'node:test';
import { anglesOf, axesOf, requestOf } from '../../../../daemon/page/parts/jog_step.js';
import { approachRequest, leftOf, touchRequest } from '../../../../daemon/page/parts/touch_request.js';
import { numberOf } from '../../../../daemon/page/parts/typed.js';

const how = { axis: 2, frame: 'flange', speed_mm_s: 25, step_deg: 5, step_mm: 10, angles_deg: [1, 2, 3, 4, 5, 6] };

test('a jog moves one axis, along or about one axis of a frame, or all axes', () => {
  const rows = [
    ['axis', -1, { axis: 2, by_deg: -5, speed_mm_s: 25 }],
    ['shift', 1, { frame: 'flange', shift_mm: [0, 10, 0], speed_mm_s: 25 }],
    ['turn', -1, { frame: 'flange', turn_deg: [0, -5, 0], speed_mm_s: 25 }],
    ['angles', 1, { joints_deg: [1, 2, 3, 4, 5, 6], speed_mm_s: 25 }],
  ];
  for (const [mode, sign, body] of rows) assert.deepEqual(requestOf({ ...how, mode }, sign), body);
  assert.deepEqual(axesOf('axis', [0, 0, 0, 0, 0, 0, 0]), [1, 2, 3, 4, 5, 6, 7]);
});

test('angles are numbers in the notation of any language, or none', () => {
  assert.deepEqual(anglesOf(['1.5', '−2,5', ' 3 ']), [1.5, -2.5, 3]);
  for (const texts of [[], ['1', ''], ['1', 'two'], ['Infinity']]) assert.equal(anglesOf(texts), null);
  assert.ok(Number.isNaN(numberOf(' ')));
});

test('a touch begins a test with tip and tolerance, or adds to one', () => {
  const tip = { flange_tip_mm: [0, 0, 200] };
  assert.deepEqual(touchRequest({ test: null, tip, verification: 'v', id: 10, tolerance_mm: 0.5 }), { tip, verification: 'v', touches: [{ id: 10 }], tolerance_mm: 0.5 });
  assert.deepEqual(touchRequest({ test: null, tip, verification: 'v', id: 0, tolerance_mm: NaN }), { tip, verification: 'v', touches: [{ id: 0 }] });
  assert.deepEqual(touchRequest({ test: { id: 't' }, tip, verification: 'v', id: 3, tolerance_mm: 9 }), { adds_to: 't', touches: [{ id: 3 }] });
});

test('an approach names the point, and a step only when one is asked for', () => {
  const tip = { flange_tip_mm: [0, 0, 200] };
  const of = { tip, verification: 'v' };
  assert.deepEqual(approachRequest({ test: null, ...of, id: 0, step_mm: null }), { ...of, touch: { id: 0 }, stand_off_mm: 20 });
  assert.deepEqual(approachRequest({ test: { id: 't' }, ...of, id: 3, step_mm: 2 }), { adds_to: 't', touch: { id: 3 }, stand_off_mm: 20, step_mm: 2 });
});

test('what is left is known while the arm stands where the approach ended', () => {
  const pose = (z, w = 1) => ({ base_T_flange: { translation_mm: [0, 0, z], quaternion_wxyz: [w, Math.sqrt(1 - w * w), 0, 0] } });
  const touch = { left_mm: 20, beside_mm: 0 };
  const run = { state: 'finished', result: { ...pose(100), touch } };
  for (const stands of [pose(100), pose(100.01), pose(100, -1)]) assert.deepEqual(leftOf(run, stands), touch);
  for (const stands of [pose(100.2), pose(100, 0.999), {}, null]) assert.equal(leftOf(run, stands), null);
  for (const other of [null, { state: 'aborted', result: null }, { state: 'finished', result: pose(100) }]) assert.equal(leftOf(other, pose(100)), null);
});
