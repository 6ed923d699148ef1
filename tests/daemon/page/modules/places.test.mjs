// Camera and target of both set-ups, in the base.
import assert from 'node:assert/strict';
import test from 'node:test';
import { placesOf } from '../../../../daemon/page/parts/places.js';

const at = (x, y, z) => ({ translation_mm: [x, y, z], quaternion_wxyz: [1, 0, 0, 0] });
const flange = at(100, 0, 500);

test('a camera on the flange moves with it, its target stands', () => {
  const { camera, target } = placesOf({ flange_T_camera: at(0, 0, 50), base_T_target: at(900, 0, 200) }, flange);
  assert.deepEqual([camera.translation_mm, target.translation_mm], [[100, 0, 550], [900, 0, 200]]);
});

test('a camera beside the robot stands, its target moves with the flange', () => {
  const { camera, target } = placesOf({ base_T_camera: at(900, 0, 800), flange_T_target: at(0, 0, 30) }, flange);
  assert.deepEqual([camera.translation_mm, target.translation_mm], [[900, 0, 800], [100, 0, 530]]);
});

test('without a calibration or a pose nothing is drawn', () => {
  assert.deepEqual(placesOf(undefined, flange), { camera: null, target: null });
  assert.deepEqual(placesOf({ flange_T_camera: at(0, 0, 50) }, undefined), { camera: null, target: null });
});
