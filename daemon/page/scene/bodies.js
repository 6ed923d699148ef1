// What stands in the scene of the cell: the arm as thick lines with balls, cameras as pyramids, the target, the box.
import {
  BufferGeometry, CylinderGeometry, DoubleSide, Float32BufferAttribute, GridHelper, Group, LineBasicMaterial, LineDashedMaterial, LineSegments, Mesh,
  MeshBasicMaterial, MeshLambertMaterial, Quaternion, SphereGeometry, Vector3,
} from '../vendor/three.js';

const UP = new Vector3(0, 1, 0);
const RADII_MM = [95, 80, 62, 45, 34, 30, 28];

export function floor(colour) {
  const grid = new GridHelper(4000, 20, colour, colour);
  grid.rotation.x = Math.PI / 2;
  grid.material.transparent = true;
  grid.material.opacity = 0.35;
  return grid;
}

/** The arm along `points` (n, 3) in mm. */
export function arm(points, colour) {
  const group = new Group();
  const material = new MeshLambertMaterial({ color: colour });
  points.forEach((point, index) => {
    const here = new Vector3(...point);
    const radius = RADII_MM[Math.min(index, RADII_MM.length - 1)];
    const ball = new Mesh(new SphereGeometry(radius * 1.06, 24, 16), material);
    ball.position.copy(here);
    group.add(ball);
    if (index + 1 >= points.length) return;
    const way = new Vector3(...points[index + 1]).sub(here);
    if (way.length() < 1) return;
    const next = RADII_MM[Math.min(index + 1, RADII_MM.length - 1)];
    const limb = new Mesh(new CylinderGeometry(next, radius, way.length(), 24), material);
    limb.position.copy(here).addScaledVector(way, 0.5);
    limb.quaternion.setFromUnitVectors(UP, way.normalize());
    group.add(limb);
  });
  return group;
}

/** A camera as a pyramid that opens along its z. */
export function frustum(pose, { colour, length = 130, dashed = false, filled = false } = {}) {
  const [w, h] = [length * 0.45, length * 0.3];
  const corners = [[-w, -h], [w, -h], [w, h], [-w, h]].map(([x, y]) => [x, y, length]);
  const lines = corners.flatMap((corner, index) => [0, 0, 0, ...corner, ...corner, ...corners[(index + 1) % 4]]);
  const geometry = new BufferGeometry().setAttribute('position', new Float32BufferAttribute(lines, 3));
  const material = dashed ? new LineDashedMaterial({ color: colour, dashSize: 22, gapSize: 14 }) : new LineBasicMaterial({ color: colour });
  const group = new Group();
  const edges = new LineSegments(geometry, material);
  if (dashed) edges.computeLineDistances();
  group.add(edges);
  if (filled) {
    const faces = [0, 1, 2, 3].flatMap((index) => [0, 0, 0, ...corners[index], ...corners[(index + 1) % 4]]);
    const sides = new BufferGeometry().setAttribute('position', new Float32BufferAttribute(faces, 3));
    group.add(new Mesh(sides, new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.35, side: DoubleSide, depthWrite: false })));
  }
  place(group, pose);
  return group;
}

/** The target as a plate with a frame, only its frame without a `colour`, between x0 and x1, and y0 and y1, in its own plane. */
export function plate(pose, [x0, x1], [y0, y1], colour, edge) {
  const corners = [[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]];
  const group = new Group();
  const face = colour !== null && new BufferGeometry().setAttribute('position', new Float32BufferAttribute([0, 1, 2, 0, 2, 3].flatMap((i) => corners[i]), 3));
  if (face) group.add(new Mesh(face, new MeshBasicMaterial({ color: colour, side: DoubleSide })));
  group.add(outline(corners, edge));
  place(group, pose);
  return group;
}

export function outline(corners, colour) {
  const points = corners.flatMap((corner, index) => [...corner, ...corners[(index + 1) % corners.length]]);
  return new LineSegments(new BufferGeometry().setAttribute('position', new Float32BufferAttribute(points, 3)), new LineBasicMaterial({ color: colour }));
}

const PIECES = 40; // of an edge of the box, each within reach or out of it

/** The edges of the box, from corner to corner: [[from, to] ...]. */
function edgesOf(low, high) {
  const at = (bits) => [0, 1, 2].map((axis) => (bits & (1 << axis) ? high[axis] : low[axis]));
  return [0, 1, 2, 3, 4, 5, 6, 7].flatMap((corner) => [1, 2, 4].filter((bit) => !(corner & bit)).map((bit) => [at(corner), at(corner | bit)]));
}

/** The parts of the box's edges whose middle is `beyond(point)`, as full lines. */
export function boxBeyond(low, high, beyond, colour) {
  const between = ([from, to], share) => from.map((value, axis) => value + (to[axis] - value) * share);
  const parts = edgesOf(low, high).flatMap((edge) => Array.from({ length: PIECES }, (_, piece) => [0, 0.5, 1].map((share) => between(edge, (piece + share) / PIECES))));
  const points = parts.filter(([, middle]) => beyond(middle)).flatMap(([from, , to]) => [...from, ...to]);
  return new LineSegments(new BufferGeometry().setAttribute('position', new Float32BufferAttribute(points, 3)), new LineBasicMaterial({ color: colour }));
}

/** The edges of the box that the flange stays in. */
export function box(low, high, colour) {
  const edges = edgesOf(low, high).flat(2);
  const lines = new LineSegments(
    new BufferGeometry().setAttribute('position', new Float32BufferAttribute(edges, 3)),
    new LineDashedMaterial({ color: colour, dashSize: 40, gapSize: 30 }),
  );
  lines.computeLineDistances();
  return lines;
}

function place(group, { translation_mm, quaternion_wxyz: [w, x, y, z] }) {
  group.position.set(...translation_mm);
  group.quaternion.copy(new Quaternion(x, y, z, w).normalize());
}

export function discard(group) {
  group.traverse((part) => {
    part.geometry?.dispose();
    part.material?.dispose();
  });
  group.removeFromParent();
}
