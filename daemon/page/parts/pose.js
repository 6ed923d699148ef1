// Rotations and poses as the documents hold them: quaternions w first, lengths mm (pure).

export const conjugate = ([w, x, y, z]) => [w, -x, -y, -z];

export function multiply([a, b, c, d], [e, f, g, h]) {
  return [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];
}

/** The vector turned by a quaternion. */
export function turn(q, [x, y, z]) {
  const [, a, b, c] = multiply(multiply(q, [0, x, y, z]), conjugate(q));
  return [a, b, c];
}

export function compose(a, b) {
  const moved = turn(a.quaternion_wxyz, b.translation_mm);
  return {
    translation_mm: a.translation_mm.map((value, axis) => value + moved[axis]),
    quaternion_wxyz: multiply(a.quaternion_wxyz, b.quaternion_wxyz),
  };
}

/** A rotation vector in degrees. */
export function rotationVector_deg([w, x, y, z]) {
  const [sign, length] = [w < 0 ? -1 : 1, Math.hypot(x, y, z)];
  if (length < 1e-12) return [0, 0, 0];
  const angle = 2 * Math.atan2(length, sign * w) * (180 / Math.PI);
  return [x, y, z].map((value) => (sign * value * angle) / length);
}

/** The turns about x, y and z of a frame, each about the axis as the one before left it, that make up a rotation; degrees. */
export function turnsInOrder_deg([w, x, y, z]) {
  const b = Math.asin(Math.min(1, Math.max(-1, 2 * (x * z + w * y))));
  const a = Math.atan2(2 * (w * x - y * z), 1 - 2 * (x * x + y * y));
  const c = Math.atan2(2 * (w * z - x * y), 1 - 2 * (y * y + z * z));
  return [a, b, c].map((angle) => angle * (180 / Math.PI));
}

/** The way from `here` to `there`: turns about the flange's axes in degrees, shifts in the base in mm. */
export function wayToGo(here, there) {
  return {
    turns_deg: rotationVector_deg(multiply(conjugate(here.quaternion_wxyz), there.quaternion_wxyz)),
    shifts_mm: there.translation_mm.map((value, axis) => value - here.translation_mm[axis]),
  };
}

/** As `wayToGo`, the turns one after the other: each is left to do once those before it are done. */
export function wayInSteps(here, there) {
  const turns_deg = turnsInOrder_deg(multiply(conjugate(here.quaternion_wxyz), there.quaternion_wxyz));
  return { turns_deg, shifts_mm: wayToGo(here, there).shifts_mm };
}

/** The pose after one turn about the flange's axis 0, 1 or 2 by degrees ('turn'), or one shift along the base's by mm ('shift'). */
export function alongAxis(here, kind, axis, by) {
  const only = (value) => [0, 1, 2].map((one) => (one === axis ? value : 0));
  if (kind === 'shift') return { ...here, translation_mm: here.translation_mm.map((value, one) => value + only(by)[one]) };
  const half = (by * Math.PI) / 360;
  return { ...here, quaternion_wxyz: multiply(here.quaternion_wxyz, [Math.cos(half), ...only(Math.sin(half))]) };
}

/** The same one after the other, as whole degrees and millimetres: { turn_axis, deg } for each turn, then { shift_mm }. */
export function stepsTo(here, there) {
  const { turns_deg, shifts_mm } = wayInSteps(here, there);
  const shift_mm = shifts_mm.map(Math.round);
  const steps = turns_deg.map(Math.round).map((deg, axis) => ({ turn_axis: 'xyz'[axis], deg })).filter(({ deg }) => deg !== 0);
  return shift_mm.some((value) => value !== 0) ? [...steps, { shift_mm }] : steps;
}
