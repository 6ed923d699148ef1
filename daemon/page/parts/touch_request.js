// What a touch test asks of the daemon: the move of the tip towards a point, and the touch of the standing arm (pure).

export const STAND_OFF_MM = 20;
export const STEPS_MM = [0.5, 1, 2, 5];

/** The body of POST /touch for one point. Adds to `test` where there is one: tip, verification and tolerance are then those of that test. */
export function touchRequest({ test, tip, verification, id, tolerance_mm }) {
  const touches = [{ id }];
  if (test) return { adds_to: test.id, touches };
  return { tip, verification, touches, ...(tolerance_mm > 0 ? { tolerance_mm } : {}) };
}

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
