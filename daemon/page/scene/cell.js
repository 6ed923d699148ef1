// The cell in three dimensions: arm, box, target, views taken (solid), planned (dashed), the next (filled), numbered in their order.
import { Group, Vector3 } from '../vendor/three.js';
import { armBody, isDrawable } from './arm_body.js';
import { arm, box, boxBeyond, discard, floor, frustum, outline, plate } from './bodies.js';
import { createHandles } from './handles.js';
import { createNumbers } from './numbers.js';
import { beyondReach } from './reach.js';
import { createView } from './view.js';

const FLANGE_MM = 40;
const COLOURS = {
  light: { grid: 0x8a949e, arm: 0xa9b1b9, casts: [0x6c7680, 0xd3d8dc], seen: 0x2b3137, next: 0x0a5299, target: 0xffffff, edge: 0x1b1f23, box: 0x5a6570, beyond: 0x9a1028 },
  dark: { grid: 0x6a747e, arm: 0x8f99a3, casts: [0x5b6670, 0xaab4bd], seen: 0xdfe5ea, next: 0x8ec2ff, target: 0xf4f6f8, edge: 0xc3ccd4, box: 0x98a3ad, beyond: 0xffa9b0 },
};

/** A scene on `canvas`, or null where nothing can be drawn. `show(parts, dark)` replaces what has changed. */
export async function createCellScene(canvas) {
  let onDraw = () => {};
  const view = await createView(canvas, { onDraw: () => onDraw() });
  if (!view) return null;
  const shown = new Map();
  const bodies = {};
  const project = (point) => new Vector3(...point).project(view.camera);
  const numbers = view.flat ? null : createNumbers(canvas, project);
  let handles = null; // made when a box is to be dragged for the first time
  onDraw = () => {
    numbers?.place();
    handles?.place();
  };
  let framed = '';
  let added = false;
  const put = (name, key, make) => {
    const before = shown.get(name);
    if (before?.key === key) return;
    if (before) discard(before.group);
    const group = new Group();
    for (const part of make()) group.add(part);
    view.scene.add(group);
    shown.set(name, { key, group });
    added = true;
  };
  return {
    flat: view.flat,
    /**
     * The arm is a body where its lengths and joints are known and it can be drawn as one, else thick lines along its skeleton.
     * `reach`: red is what of the box's edges the arm cannot reach. `dragged(axis, end, mm)`: told where a face of the box is drawn to.
     */
    show({ reach, dragged, skeleton_mm, lengths_mm, joints_deg, ghost_deg, box_mm, target, outline_mm, views = [], planned = [], next, here, ghost_mm, carried = 'camera' }, dark) {
      const colour = dark ? COLOURS.dark : COLOURS.light;
      const of = (value) => `${dark}${JSON.stringify(value ?? null)}`;
      put('floor', of(0), () => [floor(colour.grid)]);
      const drawable = !view.flat && isDrawable(lengths_mm);
      const body = (name, joints, colours, how) => {
        put(name, of([lengths_mm, Boolean(joints)]), () => {
          bodies[name] = joints ? armBody(lengths_mm, colours, how) : null;
          return joints ? [bodies[name].group] : [];
        });
        if (joints) bodies[name].pose(joints);
        view.draw();
      };
      if (drawable && skeleton_mm && joints_deg) body('arm', joints_deg, colour.casts);
      else put('arm', of(skeleton_mm), () => (skeleton_mm ? [arm(skeleton_mm, colour.arm)] : []));
      if (drawable && ghost_deg) body('ghost', ghost_deg, [colour.next, colour.next], { ghost: true });
      else put('ghost', of(ghost_mm), () => (ghost_mm ? [outline([...ghost_mm, ...ghost_mm.slice(1, -1).reverse()], colour.next)] : []));
      put('box', of(box_mm), () => (box_mm ? [box(...box_mm, colour.box)] : []));
      const beyond = box_mm && reach && lengths_mm && ((point) => beyondReach(lengths_mm, point) > 0);
      put('beyond', of([beyond && lengths_mm, box_mm]), () => (beyond ? [boxBeyond(...box_mm, beyond, colour.beyond)] : []));
      put('target', of([target, outline_mm]), () => (target ? [targetOf(target, outline_mm, colour)] : []));
      const mark = (pose, look) => markOf(pose, look, { known: Boolean(target), carried, outline_mm });
      put('views', of([views, carried, Boolean(target)]), () => views.map((pose) => mark(pose, { colour: colour.seen })));
      put('planned', of([planned, carried, Boolean(target)]), () => planned.map((pose) => mark(pose, { colour: colour.next, dashed: true })));
      put('next', of([next, carried, Boolean(target)]), () => (next ? [mark(next, { colour: colour.next, filled: true, length: 160 })] : []));
      put('here', of([here, Boolean(target)]), () => (here && target ? [frustum(here, { colour: colour.seen, filled: true })] : []));
      numbers?.show({ taken: views, next, planned }, dark);
      if (dragged && !view.flat) handles ??= createHandles(canvas, project);
      handles?.show(box_mm, dragged);
      const around = of([box_mm, Boolean(skeleton_mm)]);
      const anew = box_mm && around !== framed;
      if (anew) framed = around;
      if (anew && !handles?.dragging()) { // else what is dragged would slip away below the pointer
        const low = box_mm[0].map((value, axis) => Math.min(value, [-250, -250, 0][axis]));
        const high = box_mm[1].map((value, axis) => Math.max(value, [250, 250, 900][axis]));
        view.frame(low, high);
      }
      if (added) view.drawAdded();
      added = false;
    },
    dispose() {
      for (const { group } of shown.values()) discard(group);
      numbers?.dispose();
      handles?.dispose();
      view.dispose();
    },
  };
}

/** What marks the pose of a view: the camera, or the target that the flange carries. While X is not known, so that nobody knows where they are, the flange. */
export function markOf(pose, look, { known, carried, outline_mm }) {
  if (!known) return plate(pose, [-FLANGE_MM, FLANGE_MM], [-FLANGE_MM, FLANGE_MM], null, look.colour);
  return carried === 'target' ? edgeOf(pose, outline_mm, look) : frustum(pose, look);
}

/** The plate that holds the points of the target, with a margin. */
function targetOf(pose, points_mm, colour) {
  return plate(pose, ...boundsOf(points_mm), colour.target, colour.edge);
}

/** The edge of the target where the flange holds it. */
function edgeOf(pose, points_mm, { colour }) {
  return plate(pose, ...boundsOf(points_mm), null, colour);
}

function boundsOf(points_mm) {
  const bounds = (axis) => {
    const values = points_mm?.map((point) => point[axis]) ?? [0, 200];
    return [Math.min(...values) - 15, Math.max(...values) + 15];
  };
  return [bounds(0), bounds(1)];
}
