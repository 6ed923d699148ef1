// Points of a merged cloud, view by view, first coarse and then finer within a budget (pure but for `fetchPart`).

export const FIRST_VOXEL_MM = 8;
export const AIMED_POINTS = 500_000; // 6 MB at 12 bytes a point
export const MAX_POINTS = { first: 250_000, finer: 700_000 }; // 11.4 MB for both, however large the part

/** The most points of one of `views` views, which the daemon keeps to. */
export const shareOf = (most, views) => Math.max(8, Math.floor(most / views));

/** One array of coordinates and one of view indices from the parts' float32 x, y, z. */
/** How far a cloud is that is fetched view by view; `event`: the last one that says how far a view of some scan is. */
export function shareOfParts({ index, of, view, work, before }, scan, event) {
  const mine = event && event !== before && event.scan_id === scan && event.view === view && event.work === work;
  return (index + (mine ? event.progress : 0)) / of;
}

export function joinParts(parts) {
  const total = parts.reduce((sum, { xyz }) => sum + xyz.length / 3, 0);
  const xyz = new Float32Array(3 * total);
  const view = new Float32Array(total);
  let at = 0;
  for (const part of parts) {
    xyz.set(part.xyz, 3 * at);
    view.fill(part.view, at, at + part.xyz.length / 3);
    at += part.xyz.length / 3;
  }
  return { xyz, view, points: total };
}

export const MAX_SURFACE_POINTS = 250_000; // 7 MB at 28 bytes a point
const FIELDS = 7; // x, y, z, deviation, nx, ny, nz

/** As `joinParts`, with `deviation` and `normal`, from the records of GET /scans/{id}/surface. */
export function joinSurfaces(parts) {
  const total = parts.reduce((sum, { records }) => sum + records.length / FIELDS, 0);
  const found = { xyz: new Float32Array(3 * total), view: new Float32Array(total), deviation: new Float32Array(total), normal: new Float32Array(3 * total), points: total };
  let at = 0;
  for (const { view, records } of parts) {
    for (let from = 0; from < records.length; from += FIELDS, at += 1) {
      found.xyz.set(records.subarray(from, from + 3), 3 * at);
      found.normal.set(records.subarray(from + 4, from + 7), 3 * at);
      found.deviation[at] = records[from + 3];
      found.view[at] = view;
    }
  }
  return found;
}

/** The end of a scale that nine of ten deviations lie within: 1, 2 or 5 times a power of ten; null when none is known. */
export function deviationEnd(deviation) {
  const known = deviation.filter(Number.isFinite).map(Math.abs).sort();
  if (!known.length) return null;
  const wanted = Math.max(known[Math.floor(0.9 * (known.length - 1))], 1e-3);
  const power = 10 ** Math.floor(Math.log10(wanted));
  return Number(([1, 2, 5, 10].find((factor) => factor * power >= wanted * (1 - 1e-6)) * power).toPrecision(1));
}

/** The text of the parameter `box` for the cube around `middle` with half its edge `reach`. */
export const boxAround = (middle, reach) => [-1, 1].flatMap((sign) => middle.map((value) => (value + sign * reach).toFixed(2))).join(',');

/** The edge of the cubes with which `points` at `voxel_mm` become about `budget`: the number goes with the edge squared. */
export function finerVoxel(voxel_mm, points, budget = AIMED_POINTS) {
  return Math.max(0.3, Number((voxel_mm * Math.sqrt(points / budget)).toPrecision(2)));
}

/** [low, high], each [x, y, z], of finite points. */
export function boundsOf(xyz) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let at = 0; at < xyz.length; at += 3) {
    for (let axis = 0; axis < 3; axis += 1) {
      const value = xyz[at + axis];
      if (value < low[axis]) low[axis] = value;
      if (value > high[axis]) high[axis] = value;
    }
  }
  return low[0] <= high[0] ? [low, high] : [[0, 0, 0], [1, 1, 1]];
}

/** Index of the point nearest to the ray within `limit` of it per length, the nearest of them to the eye; −1 for none. */
export function pickPoint(xyz, [ox, oy, oz], [dx, dy, dz], limit) {
  let best = -1;
  let bestScore = Infinity;
  for (let at = 0, index = 0; at < xyz.length; at += 3, index += 1) {
    const [x, y, z] = [xyz[at] - ox, xyz[at + 1] - oy, xyz[at + 2] - oz];
    const along = x * dx + y * dy + z * dz;
    if (along <= 0) continue;
    const off = Math.sqrt(Math.max(0, x * x + y * y + z * z - along * along)) / along;
    if (off > limit) continue;
    const score = along * (1 + 30 * (off / limit) * limit);
    if (score < bestScore) {
      bestScore = score;
      best = index;
    }
  }
  return best;
}
