// The first set-up: the command that prints a target, what is beyond an arm's reach, a face of the box that is dragged.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const page = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page');
const { printCommand } = await import(join(page, 'parts', 'target_words.js'));
const { beyondReach, shareBeyond } = await import(join(page, 'scene', 'reach.js'));
const { draggedTo } = await import(join(page, 'scene', 'handles.js'));

const IRB_1600_145 = [150, 486.5, 700, 0, 600, 65, 0];
const REACH_MM = 1450; // of its wrist centre from axis 1: "reach 1.45 m" of ABB's product specification 3HAC023604-001

test('the command that prints a target has its kind, counts, lengths and markers', () => {
  const commands = [
    ['charuco:12x9:1:0.75:DICT_5X5_100', 20, 15, 'charuco --columns 12 --rows 9 --square-mm 20 --marker-mm 15 --dictionary DICT_5X5_100 --page A3'],
    ['charuco:12x9:1:0.75:DICT_5X5_100', NaN, NaN, 'charuco --columns 12 --rows 9 --square-mm 20 --marker-mm 15 --dictionary DICT_5X5_100 --page A3'],
    ['chessboard:9x6:1', 25.4, NaN, 'chessboard --columns 9 --rows 6 --pitch-mm 25.4 --page A3'],
    ['circles-asymmetric:4x11:1', 18, NaN, 'circles --layout asymmetric --columns 4 --rows 11 --pitch-mm 18 --page A4'],
    ['apriltag-grid:5x7:1:0.25:tag36h11', 24, 8, 'apriltag-grid --columns 5 --rows 7 --tag-mm 24 --gap-mm 8 --family tag36h11 --page A3'],
    ['aruco-marker:1:DICT_5X5_100:7', 90, NaN, 'aruco-marker --marker-mm 90 --dictionary DICT_5X5_100 --id 7 --page A4'],
  ];
  for (const [text, length, second, expected] of commands) assert.equal(printCommand(text, length, second), `handeyed target ${expected} -o target.pdf`);
});

test('beyond reach is what lies farther than the arm stretched out, and the share of a box that does', () => {
  const [, height, , , , flange] = IRB_1600_145;
  assert.ok(Math.abs(beyondReach(IRB_1600_145, [REACH_MM + flange, 0, height])) < 1e-9);
  assert.ok(beyondReach(IRB_1600_145, [0, -REACH_MM - flange - 1, height]) > 0);
  assert.equal(shareBeyond(IRB_1600_145, [[400, -500, 450], [900, 500, 1000]]), 0);
  assert.equal(shareBeyond(IRB_1600_145, [[2000, 0, 0], [2100, 10, 10]]), 1);
  const half = shareBeyond(IRB_1600_145, [[REACH_MM + flange - 100, -1, height - 1], [REACH_MM + flange + 100, 1, height + 1]]);
  assert.ok(half > 0.3 && half < 0.6, half);
});

test('a face goes with the pointer along its axis, in steps of 10 mm, and never past the face opposite', () => {
  assert.equal(draggedTo(1300, [-30, 5], [20, 0], 400), 1150);
  assert.equal(draggedTo(1300, [0, 50], [20, 0], 400), 1300);
  assert.equal(draggedTo(1300, [-900, 0], [20, 0], 400), 410);
  assert.equal(draggedTo(400, [900, 0], [20, 0], 1300), 1290);
  assert.equal(draggedTo(1300, [30, 0], [0.1, 0.1], 400), 1300, 'one looks along the axis');
});
