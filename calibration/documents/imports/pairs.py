"""Poses of robot and camera by their rotations alone: which numbers go together, and in which conventions.

The angle by which a rigid body turned between two views is the same in both sides' poses, whatever X, the target's
place, units and directions are (`calibration.diagnosis.angle_agreement`). It costs no fit, so that every pair of
conventions can be compared, and rows of numbers can be tried as the poses of two sides.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from calibration.diagnosis.angle_agreement import angles_between, mean_mismatch_rad
from calibration.documents.imports.pose_table import PoseTable
from calibration.errors import GeometryError
from calibration.kinematics.conventions import Convention
from calibration.transforms import Array

MAX_MISMATCH_RAD = float(np.radians(2.0))
"""Mean difference of the angles up to which two sides agree."""

MORE_MISMATCH_RAD = float(np.radians(0.2))
"""Conventions whose angles differ by so much more than the best pair's are compared by the translations as well."""

MIN_PAIRS = 3
MAX_STEP_SHARE = 0.1
"""Usual distance of a row from the next, as a share of what all rows span, below which they are samples of a path."""

MAX_COMPARED = 40
"""Views by which conventions are compared."""


def angles_of(table: PoseTable, conventions: Sequence[Convention]) -> list[tuple[Convention, Array]]:
    """The angles (n, n) between the poses of a table in each convention that makes them rotations."""
    found, few = [], table.take(range(min(len(table), MAX_COMPARED)))
    for convention in conventions:
        try:
            poses = few.poses(convention, "mm", "base_T_flange")
        except GeometryError:
            continue
        found.append((convention, angles_between(poses[:, :3, :3])))
    return found


def agreeing_conventions(
    robot: PoseTable, camera: PoseTable, of_robot: Sequence[Convention], of_camera: Sequence[Convention]
) -> tuple[float, tuple[Convention, ...], tuple[Convention, ...]]:
    """The least mismatch (rad) of the angles, and the conventions of both sides that leave about as little."""
    ours, seen = angles_of(robot, of_robot), angles_of(camera, of_camera)
    compared = [
        (mean_mismatch_rad(angles, others), one, other) for one, angles in ours for other, others in seen
    ]  # fmt: skip
    least = min((mismatch for mismatch, _, _ in compared), default=np.inf)
    near = [(one, other) for mismatch, one, other in compared if mismatch <= least + MORE_MISMATCH_RAD]
    robots, cameras = (tuple(dict.fromkeys(pair[at] for pair in near)) for at in (0, 1))
    return least, robots, cameras


def best_split(splits: Iterable[tuple[PoseTable, PoseTable]]) -> PoseTable | None:
    """The robot's table with the camera's beside it, of the split whose sides turn alike; None where none does."""
    best, found = MAX_MISMATCH_RAD, None
    for robot, camera in splits:
        conventions = [one.conventions() for one in (robot, camera)]
        mismatch = agreeing_conventions(robot, camera, *conventions)[0]
        if mismatch < best:
            note = "no name says whose the poses are: that follows from what the flange carries, which is near to it"
            best, found = mismatch, replace(robot, camera=camera, side=None, notes=(*robot.notes, note))
    return found


def rows_as_pairs(table: PoseTable) -> PoseTable | None:
    """A table whose rows are the robot's and the camera's poses in turn, or all of one side, then of the other."""
    n, steps = len(table) // 2, np.linalg.norm(np.diff(table.lengths, axis=0), axis=1)
    is_path = np.median(steps) < MAX_STEP_SHARE * np.linalg.norm(np.ptp(table.lengths, axis=0))
    if len(table) % 2 or n < MIN_PAIRS or is_path:
        return None
    halves = ((range(0, 2 * n, 2), range(1, 2 * n, 2)), (range(n), range(n, 2 * n)))
    return best_split((table.take(one), table.take(other)) for one, other in halves)


def equal_sides(robot: PoseTable, camera: PoseTable) -> bool:
    """Whether both sides hold the same numbers."""
    if robot.kind != camera.kind or len(robot) != len(camera):
        return False
    pairs = ((robot.lengths, camera.lengths), (robot.numbers, camera.numbers))
    return all(np.allclose(mine, its, rtol=1e-6, atol=1e-9) for mine, its in pairs)
