// The uncertainty of a measured point as an ellipsoid, from the covariance of X (pure).

/**
 * The covariance (3, 3), mm², of a point at `point_mm` in the camera, in the camera's axes. `covariance` (6, 6): of a small
 * motion after X, turn in rad before shift in mm.
 */
export function pointCovariance(covariance, [x, y, z]) {
  const jacobian = [
    [0, z, -y, 1, 0, 0],
    [-z, 0, x, 0, 1, 0],
    [y, -x, 0, 0, 0, 1],
  ];
  const half = jacobian.map((row) => covariance[0].map((_, column) => row.reduce((sum, value, at) => sum + value * covariance[at][column], 0)));
  return half.map((row) => jacobian.map((other) => row.reduce((sum, value, at) => sum + value * other[at], 0)));
}

const SWEEPS = 30;

/** Half axes of the ellipsoid of `coverage` standard deviations, the longest first: [{ length_mm, direction }]; Jacobi's method. */
export function halfAxes(covariance, coverage = 2) {
  const a = covariance.map((row) => [...row]);
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < SWEEPS; sweep += 1) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) rotate(a, v, p, q);
  }
  return [0, 1, 2]
    .map((axis) => ({ length_mm: coverage * Math.sqrt(Math.max(0, a[axis][axis])), direction: v.map((row) => row[axis]) }))
    .sort((one, other) => other.length_mm - one.length_mm);
}

/** One rotation in the plane of p and q, after which a[p][q] is zero. */
function rotate(a, v, p, q) {
  if (Math.abs(a[p][q]) < 1e-300) return;
  const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
  const tangent = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
  const cosine = 1 / Math.hypot(tangent, 1);
  const sine = tangent * cosine;
  for (const row of [...a, ...v]) [row[p], row[q]] = [cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]];
  [a[p], a[q]] = [a[p].map((value, at) => cosine * value - sine * a[q][at]), a[q].map((value, at) => sine * a[p][at] + cosine * value)];
}

/** 1, 2 or 5 times a power of ten by which `length` becomes about `wanted`, at most that. */
export function enlargement(length, wanted) {
  if (!(length > 0 && wanted > 0)) return 1;
  const ratio = wanted / length;
  const power = 10 ** Math.floor(Math.log10(ratio));
  return [5, 2, 1].find((factor) => factor * power <= ratio * (1 + 1e-9)) * power;
}
