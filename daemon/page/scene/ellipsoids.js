// Where a measured point may be: ellipsoids of k = 2 at the points that matter, as the camera sees them, enlarged.
import { Group, Mesh, MeshLambertMaterial, SphereGeometry } from '../vendor/three.js';
import { discard, frustum } from './bodies.js';
import { createView } from './view.js';

const COLOURS = { light: { camera: 0x2b3137, points: 0x7d8893, worst: 0x0a5299 }, dark: { camera: 0xdfe5ea, points: 0x98a3ad, worst: 0x8ec2ff } };

const THINNEST = 0.006; // of the distance: thinner is not seen

/** A scene on `canvas`, or null where nothing can be drawn. `show(points, times, dark)`: points as [{ camera_mm, axes, worst }]. */
export async function createEllipsoidScene(canvas) {
  const view = await createView(canvas);
  if (!view) return null;
  let group = null;
  const upright = ([x, y, z]) => [x, z, -y]; // the camera's x right, y down, z ahead, with z up
  return {
    flat: view.flat,
    show(points, times, dark) {
      if (group) discard(group);
      group = new Group();
      const colour = dark ? COLOURS.dark : COLOURS.light;
      const far = Math.max(...points.map(({ camera_mm }) => Math.hypot(...camera_mm)), 1);
      group.add(frustum({ translation_mm: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0] }, { colour: colour.camera, length: far / 4 }));
      for (const { camera_mm, axes, worst } of points) {
        const ball = new Mesh(new SphereGeometry(1, 32, 20), new MeshLambertMaterial({ color: worst ? colour.worst : colour.points }));
        ball.matrixAutoUpdate = false;
        ball.matrix.set(...ellipsoidMatrix(axes, times, camera_mm, THINNEST * far));
        group.add(ball);
      }
      group.rotation.x = -Math.PI / 2;
      view.scene.add(group);
      const corners = [[0, 0, 0], ...points.map(({ camera_mm }) => upright(camera_mm))];
      const bound = (pick) => [0, 1, 2].map((axis) => pick(...corners.map((corner) => corner[axis])));
      view.frame(bound(Math.min), bound(Math.max), [1.1, -0.55, 0.45]);
    },
    dispose() {
      if (group) discard(group);
      view.dispose();
    },
  };
}

/** The rows of the matrix from the unit sphere to the ellipsoid of these half axes, right-handed, at `place`; none is drawn thinner than `least_mm`. */
function ellipsoidMatrix(axes, times, place, least_mm) {
  const [a, b, c] = axes.map(({ length_mm, direction }) => direction.map((value) => value * Math.max(length_mm * times, least_mm)));
  const volume = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  const sign = volume < 0 ? -1 : 1;
  return [0, 1, 2].flatMap((row) => [a[row], b[row], sign * c[row], place[row]]).concat([0, 0, 0, 1]);
}
