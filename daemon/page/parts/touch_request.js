// What a touch test asks of the daemon: the move of the tip towards a point, and the touch of the standing arm (pure).

export const STAND_OFF_MM = 20;
export const STEPS_MM = [0.5, 1, 2, 5];

/** The body of POST /touch for one point. Adds to `test` where there is one: tip, verification and tolerance are then those of that test. */
export function touchRequest({ test, tip, verification, id, tolerance_mm }) {
  const touches = [{ id }];
  if (test) return { adds_to: test.id, touches };
  return { tip, verification, touches, ...(tolerance_mm > 0 ? { tolerance_mm } : {}) };
}

/** The body of POST /touch that makes `test` anew without its touch number `index`. */
export function takenBack(test, index) {
  const touches = test.touches.touches.filter((_, at) => at !== index).map(({ id, name, base_T_flange, joints_deg, external_axes, miss_mm }) =>
    Object.fromEntries(Object.entries({ id, name, base_T_flange, joints_deg, external_axes, miss_mm }).filter(([, value]) => value !== null && value !== undefined)));
  const { tip, verification, result } = test;
  return { tip, verification, touches, ...(result.tolerance_mm > 0 ? { tolerance_mm: result.tolerance_mm } : {}) };
}

export const FAR_MM = 5; // of a touch that is asked about before it counts

/** `now`: the answer of GET /robot. How far the tip stands from the point `id` as the verification saw it, mm; null where one of them is not known. */
export function tipOff({ now, tip, points, id }) {
  const seen = points.find((point) => point.id === id)?.base_mm;
  if (!now?.base_T_flange || !tip || !seen?.length) return null;
  const { translation_mm: at, quaternion_wxyz: [w, ...axis] } = now.base_T_flange;
  const inner = cross(axis, tip.flange_tip_mm).map((value, index) => value + w * tip.flange_tip_mm[index]);
  const turned = cross(axis, inner).map((value, index) => tip.flange_tip_mm[index] + 2 * value);
  const mean = [0, 1, 2].map((index) => seen.reduce((sum, point) => sum + point[index], 0) / seen.length);
  return Math.hypot(...mean.map((value, index) => at[index] + turned[index] - value));
}

const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

/** The body of POST /touch/approach: to the stand-off before the point, or with `step_mm` so far towards it. */
export function approachRequest({ test, tip, verification, id, step_mm }) {
  const of = test ? { adds_to: test.id } : { tip, verification };
  return { ...of, touch: { id }, stand_off_mm: STAND_OFF_MM, ...(step_mm ? { step_mm } : {}) };
}

const STILL_MM = 0.05;
const STILL = 1e-4; // of a unit quaternion: 0.01°

/** `touch` of the result of a finished approach while the arm still stands where that ended; else null: what is left is not known. */
export function leftOf(run, now) {
  const { touch, base_T_flange: ended } = run?.state === 'finished' ? (run.result ?? {}) : {};
  const stands = now?.base_T_flange;
  if (!touch || !stands) return null;
  const moved_mm = Math.hypot(...stands.translation_mm.map((value, axis) => value - ended.translation_mm[axis]));
  const turned = [1, -1].map((sign) => Math.hypot(...stands.quaternion_wxyz.map((value, index) => value - sign * ended.quaternion_wxyz[index])));
  return moved_mm < STILL_MM && Math.min(...turned) < STILL ? touch : null;
}
