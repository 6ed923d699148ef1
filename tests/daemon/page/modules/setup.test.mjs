// The first set-up: where a target is printed, what is beyond an arm's reach, a face of the box that is dragged.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import test from 'node:test';

const page = join(import.meta.dirname, '..', '..', '..', '..', 'daemon', 'page');
const { printAddress, sameTarget, sizeOf } = await import(join(page, 'parts', 'target_words.js'));
const { beyondReach, shareBeyond } = await import(join(page, 'scene', 'reach.js'));
const { draggedTo } = await import(join(page, 'scene', 'handles.js'));

const IRB_1600_145 = [150, 486.5, 700, 0, 600, 65, 0];
const REACH_MM = 1450; // of its wrist centre from axis 1: "reach 1.45 m" of ABB's product specification 3HAC023604-001

test('the address that prints a target has its kind, counts and lengths, the usual ones while nobody measured it', () => {
  const printed = [
    ['charuco:12x9:1:0.734:DICT_5X5_100', 20, 14.5, 'charuco:12x9:20:14.5:DICT_5X5_100'],
    ['charuco:12x9:1:0.734:DICT_5X5_100', NaN, NaN, 'charuco:12x9:20:15:DICT_5X5_100'],
    ['charuco:12x9:1:0.6:DICT_5X5_100', 25, NaN, 'charuco:12x9:25:15:DICT_5X5_100'],
    ['chessboard:9x6:1', 25.4, NaN, 'chessboard:9x6:25.4'],
    ['circles-asymmetric:4x11:1:white', 18, NaN, 'circles-asymmetric:4x11:18:white'],
    ['apriltag-grid:5x7:1:0.25:tag36h11', 24, 8, 'apriltag-grid:5x7:24:8:tag36h11'],
    ['aruco-marker:1:DICT_5X5_100:7', 90, NaN, 'aruco-marker:90:DICT_5X5_100:7'],
  ];
  for (const [text, length, second, expected] of printed) assert.equal(printAddress(text, length, second), `/setup/target.pdf?target=${encodeURIComponent(expected)}`);
});

test('a size is taken apart as it was put together, and a target is the same whatever its lengths', () => {
  assert.deepEqual(sizeOf('200/10 15.2 calliper'), { length: '200', count: '10', second: '15.2', instrument: 'calliper' });
  assert.deepEqual(sizeOf('220,4/9 ruler-class-2'), { length: '220,4', count: '9', second: '', instrument: 'ruler-class-2' });
  assert.deepEqual(sizeOf('20'), { length: '20', count: '1', second: '', instrument: '' });
  assert.deepEqual(sizeOf(''), { length: '', count: '10', second: '', instrument: 'calliper' });
  assert.ok(sameTarget('charuco:12x9:1.0:0.76:DICT_5X5_100', 'charuco:12x9:1:0.7342:DICT_5X5_100'));
  assert.ok(!sameTarget('charuco:12x9:1:0.75:DICT_5X5_100', 'charuco:12x9:1:0.75:DICT_5X5_100:legacy'));
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
