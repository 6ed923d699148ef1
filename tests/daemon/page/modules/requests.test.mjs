// What the page asks for by a jog, a touch and a calibration.
import assert from 'node:assert/strict';
import test from 'node:test';
import { anglesOf, axesOf, requestOf } from '../../../../daemon/page/parts/jog_step.js';
import { touchRequest } from '../../../../daemon/page/parts/touch_request.js';
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
