// An arm that looks like one: its links as solids by the lengths of its kinematics. The base frame, mm, z up.
import {
  BufferGeometry, CylinderGeometry, DoubleSide, Float32BufferAttribute, Group, Mesh, MeshBasicMaterial, MeshLambertMaterial, Vector3,
} from '../vendor/three.js';

const Y = new Vector3(0, 1, 0);
const RAD = Math.PI / 180;
const [ROUND, ARC] = [24, 10]; // corners of a circle, and steps of a slab's half circle
const AXES = [[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]];

/** Whether an arm of these lengths (`lengths_mm` of GET /arm) can be drawn: one whose axes 4 and 6 meet. */
export const isDrawable = (lengths_mm) => lengths_mm?.[6] === 0;

/** A cylinder or cone between two points. */
function round(from, to, r0, r1) {
  const a = new Vector3(...from);
  const way = new Vector3(...to).sub(a);
  const place = new Group();
  place.position.copy(a).addScaledVector(way, 0.5);
  place.quaternion.setFromUnitVectors(Y, way.clone().normalize());
  place.updateMatrix();
  return new CylinderGeometry(r1, r0, way.length(), ROUND).toNonIndexed().applyMatrix4(place.matrix);
}

/** The hull of two discs in the plane of axes 2 and 3, `thick` across y, with bevelled edges, as casts have. */
function slab([x0, z0, r0], [x1, z1, r1], y, thick) {
  const length = Math.hypot(x1 - x0, z1 - z0);
  const along = Math.atan2(x1 - x0, z1 - z0);
  const open = Math.acos(Math.max(-1, Math.min(1, (r0 - r1) / (length || 1))));
  const arc = (x, z, r, from, to) => Array.from({ length: ARC + 1 }, (_, step) => {
    const angle = from + ((to - from) * step) / ARC;
    return { x, z, r, s: Math.sin(angle), c: Math.cos(angle) };
  });
  const edge = [...arc(x1, z1, r1, along - open, along + open), ...arc(x0, z0, r0, along + open, along + 2 * Math.PI - open)];
  const bevel = Math.min(r0, r1) * 0.16;
  const rings = [[-thick / 2, bevel], [-thick / 2 + bevel, 0], [thick / 2 - bevel, 0], [thick / 2, bevel]]
    .map(([across, inset]) => edge.map(({ x, z, r, s, c }) => [x + (r - inset) * s, y + across, z + (r - inset) * c]));
  const quads = [0, 1, 2].flatMap((ring) => edge.map((_, i) => {
    const j = (i + 1) % edge.length;
    return [rings[ring][i], rings[ring][j], rings[ring + 1][j], rings[ring + 1][i]];
  }));
  const ends = [rings[0], rings[3]].flatMap((ring) => ring.slice(2).map((point, i) => [ring[0], ring[i + 1], point]));
  return solid([...quads.flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]]), ...ends]);
}

function block([x0, y0, z0], [x1, y1, z1]) {
  const p = (i) => [i & 1 ? x1 : x0, i & 2 ? y1 : y0, i & 4 ? z1 : z0];
  const sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
  return solid(sides.flatMap(([a, b, c, d]) => [[p(a), p(b), p(c)], [p(a), p(c), p(d)]]));
}

function solid(triangles) {
  const geometry = new BufferGeometry().setAttribute('position', new Float32BufferAttribute(triangles.flat(2), 3));
  geometry.computeVertexNormals();
  return geometry;
}

/** The solids of the base and of each link, in its own frame, all joints zero: [shade, geometry], shade 0 for covers and 1 for casts. */
function solidsOf([forward, height, lower, up, fore, flange]) {
  const s = (lower + fore) / 1300; // the scale of what is not among the lengths
  const side = -130 * s;
  const low = 0.36 * height;
  return [
    [[0, block([-190 * s, -190 * s, 0], [190 * s, 190 * s, 26 * s])], [1, round([0, 0, 26 * s], [0, 0, low], 165 * s, 150 * s)]],
    [
      [0, round([0, 0, low], [0, 0, 0.43 * height], 158 * s, 158 * s)], [1, round([0, 0, 0.43 * height], [0, 0, 0.62 * height], 165 * s, 150 * s)],
      [1, slab([0.1 * forward, 0.6 * height, 150 * s], [forward, height, 118 * s], 0, 215 * s)],
      [0, round([forward, -150 * s, height], [forward, 152 * s, height], 88 * s, 88 * s)],
    ],
    [
      [1, slab([0, 0, 112 * s], [0, lower, 84 * s], side, 96 * s)], [0, round([0, side - 54 * s, 0], [0, side - 44 * s, 0], 70 * s, 74 * s)],
      [0, round([0, side - 54 * s, lower], [0, side - 44 * s, lower], 50 * s, 54 * s)],
    ],
    [
      [0, round([0, -90 * s, 0], [0, 92 * s, 0], 78 * s, 78 * s)], [1, slab([0, 0, 92 * s], [0, up, 86 * s], 6 * s, 150 * s)],
      [1, round([-150 * s, 6 * s, up], [0, 6 * s, up], 62 * s, 84 * s)], [0, round([-172 * s, 6 * s, up], [-150 * s, 6 * s, up], 46 * s, 50 * s)],
      [1, round([0, 6 * s, up], [0.3 * fore, 0, up], 84 * s, 68 * s)],
    ],
    [
      [0, round([0.3 * fore, 0, 0], [0.34 * fore, 0, 0], 64 * s, 64 * s)], [1, round([0.34 * fore, 0, 0], [fore - 70 * s, 0, 0], 62 * s, 50 * s)],
      ...[-52, 52].map((y) => [1, slab([fore - 90 * s, 0, 40 * s], [fore, 0, 42 * s], y * s, 26 * s)]),
      [0, round([fore, -66 * s, 0], [fore, 66 * s, 0], 40 * s, 40 * s)],
    ],
    [[1, round([0, -30 * s, 0], [0, 30 * s, 0], 46 * s, 46 * s)], [1, round([0, 0, 0], [Math.max(1, flange - 14 * s), 0, 0], 42 * s, 36 * s)]],
    [[0, round([flange - 14 * s, 0, 0], [flange, 0, 0], 40 * s, 40 * s)]],
  ];
}

/** One geometry of a link's solids, coloured by their shade: each link is drawn in one call. */
function merged(solids, colours) {
  const count = solids.reduce((sum, [, { attributes }]) => sum + attributes.position.count, 0);
  const [position, normal, color] = [0, 1, 2].map(() => new Float32Array(3 * count));
  let at = 0;
  for (const [shade, { attributes }] of solids) {
    position.set(attributes.position.array, at);
    normal.set(attributes.normal.array, at);
    const { r, g, b } = colours[shade];
    const until = at + attributes.position.array.length;
    for (; at < until; at += 3) color.set([r, g, b], at);
  }
  const geometry = new BufferGeometry();
  for (const [name, values] of Object.entries({ position, normal, color })) geometry.setAttribute(name, new Float32BufferAttribute(values, 3));
  return geometry;
}

/**
 * An arm with these lengths: { group, tool, pose(joints_deg) }; `tool` is a group in the frame of the flange, z out of it. `ghost`: transparent.
 * `colours`: [covers, casts] as numbers. The radii follow the lengths.
 */
export function armBody(lengths_mm, colours, { ghost = false } = {}) {
  const [forward, height, lower, up, fore, flange] = lengths_mm;
  const places = [[0, 0, 0], [forward, 0, height], [0, 0, lower], [0, 0, up], [fore, 0, 0], [0, 0, 0]];
  const kind = ghost ? MeshBasicMaterial : MeshLambertMaterial;
  const material = new kind({ vertexColors: true, side: DoubleSide, ...(ghost && { transparent: true, opacity: 0.22, depthWrite: false }) });
  const paints = colours.map((color) => new MeshBasicMaterial({ color }).color);
  const meshes = solidsOf(lengths_mm).map((solids) => new Mesh(merged(solids, paints), material));
  const group = new Group();
  group.add(meshes[0]);
  let inner = group;
  const links = places.map((place, axis) => {
    const link = new Group();
    link.position.set(...place);
    link.add(meshes[axis + 1]);
    inner.add(link);
    inner = link;
    return link;
  });
  if (ghost) for (const foot of meshes.slice(0, 2)) foot.visible = false; // they stand where the arm's stand
  const tool = new Group();
  tool.position.set(flange, 0, 0);
  tool.quaternion.setFromAxisAngle(Y, 90 * RAD);
  inner.add(tool);
  return {
    group, tool,
    pose(joints_deg) {
      links.forEach((link, axis) => link.quaternion.setFromAxisAngle(new Vector3(...AXES[axis]), joints_deg[axis] * RAD));
      group.updateMatrixWorld(true);
    },
  };
}
