// What one jog asks of the daemon, and in words what it does (pure).
import { numberOf } from './typed.js';

export const MODES = ['axis', 'shift', 'turn', 'angles'];
export const STEPS_DEG = [1, 5, 10, 30];
export const STEPS_MM = [1, 10, 50, 100];
export const SPEEDS_MM_S = [10, 25, 50, 100, 250];

const AXES = ['X', 'Y', 'Z'];

/** The axes to choose from: numbers of the arm's, or X, Y, Z of a frame. */
export const axesOf = (mode, joints_deg = []) => (mode === 'axis' ? joints_deg.map((_, index) => index + 1) : [1, 2, 3]);

/** Its name on a button: "3", "X", "Rx". */
export const axisName = (mode, axis) => ({ axis: String(axis), shift: AXES[axis - 1], turn: `R${AXES[axis - 1]?.toLowerCase()}` })[mode];

export const unitOf = (mode) => (mode === 'shift' ? 'mm' : '°');

/** The body of POST /robot/jog: one axis, a shift or a turn by `sign` times the step, or all axes to `angles_deg`. */
export function requestOf({ mode, axis, frame, speed_mm_s, step_deg, step_mm, angles_deg }, sign) {
  const along = (step) => [1, 2, 3].map((one) => (one === axis ? sign * step : 0));
  const moved = {
    axis: () => ({ axis, by_deg: sign * step_deg }),
    shift: () => ({ frame, shift_mm: along(step_mm) }),
    turn: () => ({ frame, turn_deg: along(step_deg) }),
    angles: () => ({ joints_deg: angles_deg }),
  }[mode]();
  return { ...moved, speed_mm_s };
}

/** Angles (numbers) out of typed texts; null while one of them is no number. */
export function anglesOf(texts) {
  const angles = texts.map(numberOf);
  return angles.length > 0 && angles.every(Number.isFinite) ? angles : null;
}
