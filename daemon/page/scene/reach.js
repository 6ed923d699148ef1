// How far an arm gets, by its lengths alone: what lies beyond is out of reach whatever its axes are limited to. The base frame, mm.
const POINTS = 9; // along each edge of a box

/** How far (mm) a point lies beyond the farthest place of the flange; 0 or less within. `lengths_mm`: of GET /arm. */
export function beyondReach([forward, height, lower, up, fore, flange, offset], [x, y, z]) {
  const fromAxis2 = Math.hypot(Math.hypot(x, y) - forward, z - height); // with axis 1 turned towards the point, which is the nearest
  return fromAxis2 - (lower + Math.hypot(up, fore) + flange + Math.abs(offset));
}

/** The share (0 to 1) of the box, with its faces, that is beyond reach. */
export function shareBeyond(lengths_mm, [low, high]) {
  const along = (axis) => Array.from({ length: POINTS }, (_, step) => low[axis] + ((high[axis] - low[axis]) * step) / (POINTS - 1));
  const points = along(0).flatMap((x) => along(1).flatMap((y) => along(2).map((z) => [x, y, z])));
  return points.filter((point) => beyondReach(lengths_mm, point) > 0).length / points.length;
}
