"""Whether the camera was still warming up in a session: the picture shifts on its sensor while the views are taken.

r (2,) is by how much a view's target was found from where the solution predicts it, in px, mean over its points.
Where the views hold a temperature T, the shift over the session is b (max T - min T) with

    r_i = a + b (T_i - mean T) + e_i,     F = |b|² sum (T_i - mean T)² / (2 s²)   of F(2, 2 (n - 2)), s² from the e_i

(least squares). Views from one pose show it without temperatures: the shift is r of the last look less r of the first,
and its noise that of an arm coming back (`REPEATABILITY`) and of the corners. Only shifts of the whole picture are
sought; a changed focal length is not.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
import scipy

from calibration.closed_forms.observability import at_station
from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.observations.observations import STATION_REPEATED
from calibration.observations.pose_model import predicted_camera_T_target
from calibration.problem import Problem, View, anchor_T_mount_of
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, Solution
from calibration.transforms import Array, map_points

MIN_RISE_C = 1.0
"""Smaller changes of temperature within a session are not looked at."""

MIN_VIEWS = 6
"""Least views with a temperature."""

FALSE_ALARM_PROBABILITY = 1e-3
"""Of a camera that stands still, in one session."""

MIN_SHARE_OF_U = 0.5
"""A shift below this share of U at the worst of the points that matter is not reported."""

REPEATABILITY = RobotNoise(0.05, float(np.radians(0.003)))
"""One standard deviation of an arm that comes back to a pose, per axis."""

WAIT_MIN = 30
"""Minutes that are advised; the next session shows whether they were enough."""


@dataclass(frozen=True)
class _Look:
    """The target in one view: `offset_px` (2,) found less predicted, at `distance_mm` from a camera of `focal_px`."""

    view: View
    offset_px: Array
    distance_mm: float
    focal_px: float

    @property
    def mm_per_px(self) -> float:
        return self.distance_mm / self.focal_px

    def sigma_px(self, image_px: float) -> float:
        """One standard deviation of the offset per axis, of an arm that comes back and of corners of `image_px`."""
        assert self.view.detection is not None
        arm_px = REPEATABILITY.translation_mm / self.mm_per_px, REPEATABILITY.rotation_rad * self.focal_px
        return float(np.linalg.norm([*arm_px, image_px / sqrt(len(self.view.detection.ids))]))


@dataclass(frozen=True)
class _Shift:
    """How far the picture shifted during the session."""

    mm: float
    message: Sentence


def warming_findings(problem: Problem, solution: Solution) -> tuple[Finding, ...]:
    """At most one finding `still-warming`: the shift is more than chance, and matters beside the stated U."""
    if solution.uncertainty is None:
        return ()
    worst_mm = solution.uncertainty.worst_point.expanded_mm
    looks, image_px = _looks(problem, solution), solution.noise.image_px or 0.0
    shifts = [shift for shift in (_shift_with_temperature(looks), _shift_between_looks(looks, image_px)) if shift]
    for shift in shifts:
        if shift.mm > MIN_SHARE_OF_U * worst_mm:
            advice = Sentence("let-camera-warm-up", minutes=WAIT_MIN)
            return (Finding("still-warming", "warning", shift.message, advice),)
    return ()


def _looks(problem: Problem, solution: Solution) -> list[_Look]:
    """Of the views in use, and of those at a station of an earlier one, in their order."""
    X, Y, camera = solution.mount_T_camera, solution.anchor_T_target, solution.camera
    if X is None or Y is None or camera is None:
        return []
    used = {view.index for view in solution.views if view.status != "rejected" or view.reason == STATION_REPEATED}
    looks = []
    for view in problem.views:
        if view.detection is None or view.index not in used:
            continue
        pose = predicted_camera_T_target(anchor_T_mount_of(problem.setup, view.base_T_flange), X, Y)
        points = map_points(pose, problem.target.points_mm[view.detection.ids])
        offset = np.mean(view.detection.corners_px - camera.project(points), axis=0)
        if np.all(np.isfinite(offset)):
            focal_px = sqrt(camera.matrix[0, 0] * camera.matrix[1, 1])
            looks.append(_Look(view, offset, float(np.mean(points[:, 2])), focal_px))
    return looks


def _shift_with_temperature(looks: list[_Look]) -> _Shift | None:
    """The shift that goes with the temperatures, where it is more than chance."""
    warm = [(look, look.view.camera_temperature_c) for look in looks if look.view.camera_temperature_c is not None]
    temperatures = np.array([temperature for _, temperature in warm])
    if len(warm) < MIN_VIEWS or np.ptp(temperatures) < MIN_RISE_C:
        return None
    offsets = np.array([look.offset_px for look, _ in warm])
    above = temperatures - temperatures.mean()
    slope = above @ offsets / (above @ above)
    left = offsets - offsets.mean(axis=0) - above[:, None] * slope
    dof = 2 * (len(warm) - 2)
    variance = float(np.sum(left**2)) / dof
    explained = float(slope @ slope * (above @ above)) / 2
    if explained <= variance * float(scipy.special.fdtri(2, dof, 1 - FALSE_ALARM_PROBABILITY)):
        return None
    shift_px = float(np.linalg.norm(slope) * np.ptp(temperatures))
    shift_mm = shift_px * float(np.mean([look.mm_per_px for look, _ in warm]))
    return _Shift(shift_mm, Sentence(
        "still-warming", low_c=float(temperatures.min()), high_c=float(temperatures.max()), shift_px=shift_px,
        shift_mm=shift_mm,
    ))  # fmt: skip


def _shift_between_looks(looks: list[_Look], image_px: float) -> _Shift | None:
    """The largest shift between a first and a later look from one pose, where it is more than chance."""
    poses = np.array([look.view.base_T_flange for look in looks])
    firsts = [looks[int(np.argmax(at_station(poses, pose)))] for pose in poses]
    pairs = [(first, look) for first, look in zip(firsts, looks, strict=True) if first is not look]
    shifts = []
    for first, last in pairs:
        shift_px, sigma_px = float(np.linalg.norm(last.offset_px - first.offset_px)), sqrt(2) * last.sigma_px(image_px)
        if (shift_px / sigma_px) ** 2 > float(scipy.special.chdtri(2, FALSE_ALARM_PROBABILITY / len(pairs))):
            shift_mm = shift_px * last.mm_per_px
            shifts.append(_Shift(shift_mm, Sentence(
                "still-warming-looks", views=[first.view.index, last.view.index], shift_px=shift_px,
                shift_mm=shift_mm, sigma_px=sigma_px,
            )))  # fmt: skip
    return max(shifts, key=lambda shift: shift.mm, default=None)
