// Where camera and target are, by a calibration: one of them is carried by the flange, the other stands (pure).
import { compose } from './pose.js';

/** { camera, target } in the base while the flange is at `base_T_flange`; null where that is not known. */
export function placesOf(calibration, base_T_flange) {
  const { flange_T_camera, base_T_camera, flange_T_target, base_T_target } = calibration ?? {};
  const carried = (pose) => (pose && base_T_flange ? compose(base_T_flange, pose) : null);
  return { camera: base_T_camera ?? carried(flange_T_camera), target: base_T_target ?? carried(flange_T_target) };
}

/** What the flange carries, 'camera' or 'target', and `at(base_T_flange)`: where that is; where the flange is while nothing is known. `setup`: of the cell. */
export function carriedBy(calibration, setup) {
  const x = calibration?.flange_T_camera ?? calibration?.flange_T_target;
  return { carried: calibration?.flange_T_target || (!x && setup === 'eye-to-hand') ? 'target' : 'camera', at: (pose) => (x ? compose(pose, x) : pose) };
}
