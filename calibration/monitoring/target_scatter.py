"""Scatter of the target's points in its anchor's frame over several positions, as in Tab. 1 of Song et al.

Eq. (10) of the paper, with X in the direction that the paper's numbers show:
P_base = base_T_flange @ flange_T_camera @ P_camera; with the target on the flange and the camera beside the robot
P_flange = flange_T_base @ base_T_camera @ P_camera.
"""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calibration.documents.calibration import CalibrationDocument
from calibration.errors import CalibrationError
from calibration.observations.observations import observe
from calibration.observations.view_poses import candidate_poses
from calibration.problem import ANCHORS, Problem, anchor_T_mount_of
from calibration.transforms import Array, map_points


class VerificationError(CalibrationError):
    """The positions share no point of the target, or a pose of the target is not finite."""


@dataclass(frozen=True, eq=False)
class Verification:
    """`points_mm` (positions, points, 3) of the target points `ids` (points,) seen from every position.

    `frame`: in which they stand still. `base_T_flange`: (positions, 4, 4), `joints_rad`: of each where known.
    """

    stations: tuple[int, ...]
    ids: NDArray[np.intp]
    frame: Literal["base", "flange"]
    points_mm: Array
    base_T_flange: Array
    joints_rad: tuple[Array | None, ...]

    @property
    def sigma_per_point_mm(self) -> Array:
        """(points, 3) standard deviation over the positions, n - 1."""
        sigma: Array = np.std(self.points_mm, axis=0, ddof=1)
        return sigma

    @property
    def sigma_mm(self) -> Array:
        """(3,) over all points: the root of the mean variance in x, y and z."""
        sigma: Array = np.sqrt(np.mean(self.sigma_per_point_mm**2, axis=0))
        return sigma

    def cross(self) -> NDArray[np.intp]:
        """Up to five columns of `points_mm` for a report: four corners of the target and its middle."""
        mean = self.points_mm.mean(axis=0)
        offset = mean - mean.mean(axis=0)
        _, _, axes = np.linalg.svd(offset, full_matrices=False)
        along = offset @ axes[:2].T
        corners = [int(np.argmax(along @ direction)) for direction in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        middle = int(np.argmin(np.linalg.norm(offset, axis=1)))
        return np.array(sorted({*corners, middle}), np.intp)


def verify(problem: Problem, calibration: CalibrationDocument) -> Verification:
    """The target's points in its anchor's frame, from each view by `calibration`. Raises VerificationError.

    The target has the size that the calibration found of it.
    """
    assert problem.camera is not None
    assert calibration.mount_T_camera is not None
    scale = calibration.scale_of(problem.target)
    seen, _ = observe(problem)
    seen = replace(seen, points_mm=scale * seen.points_mm)
    poses, _ = candidate_poses(seen, problem.camera)
    anchor_T_mount = anchor_T_mount_of(calibration.setup, seen.base_T_flange)
    anchor_T_target = anchor_T_mount @ calibration.mount_T_camera.transform() @ poses[:, 0]
    ids = _common_ids(problem, seen.positions)
    points = map_points(anchor_T_target, scale * problem.target.points_mm[ids])
    stations = tuple(problem.views[position].index + 1 for position in seen.positions)
    if not isfinite(float(points.sum())):
        raise VerificationError("a picture's pose of the target is not finite: look at the pictures")
    joints = tuple(problem.views[position].stance.joints_rad for position in seen.positions)
    return Verification(stations, ids, ANCHORS[calibration.setup], points, seen.base_T_flange, joints)


def _common_ids(problem: Problem, positions: NDArray[np.intp]) -> NDArray[np.intp]:
    """Ids (n,) of the points detected in every view. Raises VerificationError when there are none."""
    sets = [set(view.detection.ids.tolist()) for p in positions if (view := problem.views[p]).detection is not None]
    shared = set.intersection(*sets) if sets else set()
    if len(sets) < 2 or not shared:
        raise VerificationError("the positions share no point of the target: choose positions that look at one part")
    return np.array(sorted(shared), np.intp)
