"""Kinematics of a 6-axis arm with a spherical wrist, ABB's conventions, millimetres and radians.

All joints zero: lower arm upright, forearm straight ahead, `flange` is tool0, its z out of the mounting face.
The wrist centre is decoupled after Pieper; the eight closed-form branches are numbered as ABB's cfx (RAPID
reference, confdata), so that a branch is found by its configuration and not by search.
"""

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calibration.errors import CalibrationError, ErrorWithFix, GeometryError
from calibration.kinematics.axis_rotations import rotation_x, rotation_y, rotation_z, wrap
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, transform

LIMIT_SLACK_RAD = 1e-7
"""A joint this far beyond its limit still counts as inside: float32 on the wire may push it there."""
QUADRANT_SLACK_RAD = 1e-4
"""A joint this near a quarter turn counts as on either side: float32 rounding must not change the posture."""
SINGULAR_EXACT = 1e-10
SINGULAR_ON_THE_WIRE = 1e-6
"""Sine of axis 5 below which a float32 quaternion no longer determines axes 4 and 6 separately."""
MIN_RANGE_RAD = float(np.radians(5.0))
"""Half the range of an axis that hardly moved."""
STRAIGHT_WRIST_SAMPLES = 19
"""Values of axis 4 that stand for its quarter turn where it is free: one every 5°."""

RIGID_TOLERANCE = 1e-6
_BITS = _BEHIND_AXIS_1, _BEHIND_LOWER_ARM, _AXIS_5_NEGATIVE = 4, 2, 1
_CFX = np.arange(8)
_FRONT = np.where(_CFX & _BEHIND_AXIS_1, -1.0, 1.0)
_ELBOW = np.where(_CFX & _BEHIND_LOWER_ARM, -1.0, 1.0)
_WRIST = np.where(_CFX & _AXIS_5_NEGATIVE, -1.0, 1.0)
TOOL0_IN_AXIS_6 = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # 90° about y


class Configuration(NamedTuple):
    """ABB confdata: quarter turns of axes 1, 4 and 6, and cfx 0..7.

    cfx = 4 (wrist centre behind axis 1) + 2 (behind the lower arm) + 1 (axis 5 negative).
    """

    cf1: int
    cf4: int
    cf6: int
    cfx: int


class UnreachablePoseError(CalibrationError, ErrorWithFix):
    """The arm cannot take a pose. `what` and `fix` are sentences for people."""


class OutOfReach(UnreachablePoseError):
    """The wrist centre is `excess_mm` beyond the reach, or too near the shoulder."""

    def __init__(self, arm: str, excess_mm: float, too_near: bool) -> None:
        self.excess_mm, self.too_near = excess_mm, too_near
        where, to = ("too-near", "away") if too_near else ("beyond-reach", "towards")
        super().__init__(Sentence(f"wrist-{where}", excess_mm=excess_mm, arm=arm), Sentence(f"move-pose-{to}"))


class OutsideJointLimits(UnreachablePoseError):
    """Within reach, but axis `axis` (1..6) would stand `excess_rad` beyond its limit at best."""

    def __init__(self, arm: str, axis: int, excess_rad: float) -> None:
        self.axis = axis
        what = Sentence("axis-beyond-limit", axis=axis, arm=arm, excess_deg=np.degrees(excess_rad))
        super().__init__(what, Sentence("turn-or-shift-pose"))


class OtherConfiguration(UnreachablePoseError):
    """Reachable, but not in the `wanted` configuration; `available` lists those in which it is."""

    def __init__(self, wanted: Configuration, available: tuple[Configuration, ...]) -> None:
        self.wanted, self.available = wanted, available
        what = Sentence("configuration-not-reachable", wanted=str([*wanted]))
        super().__init__(what, Sentence("use-configuration", available=[str([*one]) for one in available]))


class LimitedJoints:
    """What every arm does with the limits of its axes and with its configurations."""

    name: str
    lower_rad: tuple[float, ...]
    upper_rad: tuple[float, ...]

    def require_within_limits(self, joints_rad: ArrayLike) -> None:
        """Raises OutsideJointLimits for the axis of all joints (n,) that is furthest beyond its limits."""
        excess = self._excess_rad(checked_joints(joints_rad, len(self.lower_rad)))
        if excess.max() > LIMIT_SLACK_RAD:
            raise OutsideJointLimits(self.name, int(excess.argmax()) + 1, float(excess.max()))

    def configuration(self, joints_rad: ArrayLike) -> Configuration:
        """ABB confdata of joints (n,)."""
        q = checked_joints(joints_rad, len(self.lower_rad))
        cf1, cf4, cf6 = (int(np.floor(q[axis] / (np.pi / 2))) for axis in (0, 3, 5))
        return Configuration(
            cf1, cf4, cf6, sum(bit for bit, side in zip(_BITS, self._sides(q), strict=True) if side < 0)
        )

    def _of_configuration(self, solutions: Array, wanted: Configuration) -> Array:
        """Those of the joints (k, n), k >= 1, in that configuration. Raises OtherConfiguration."""
        fitting: Array = solutions[[self._has_configuration(joints, wanted) for joints in solutions]]
        if not len(fitting):
            raise OtherConfiguration(wanted, tuple(dict.fromkeys(self.configuration(joints) for joints in solutions)))
        return fitting

    def _has_configuration(self, joints: Array, wanted: Configuration) -> bool:
        """Whether joints (n,) have that configuration, within QUADRANT_SLACK_RAD."""
        quarters = joints[[0, 3, 5]] / (np.pi / 2) - np.array(wanted[:3])
        slack = QUADRANT_SLACK_RAD
        in_quadrants = np.all((quarters >= -slack) & (quarters <= 1 + slack))
        signs = np.where([wanted.cfx & bit for bit in _BITS], -1, 1)
        return bool(in_quadrants and np.all(signs * self._sides(joints) >= -slack))

    def _sides(self, q: Array) -> Array:
        """Signed distances (..., 3) of joints (..., n) from the postures that part the bits 4, 2 and 1 of cfx."""
        raise NotImplementedError

    def _excess_rad(self, joints: Array) -> Array:
        excess: Array = np.maximum(np.array(self.lower_rad) - joints, joints - np.array(self.upper_rad))
        return excess

    def _turns(self, joints: Array) -> Array:
        """The same posture (k, n) with whole turns added wherever the limits allow."""
        choices = []
        for angle, low, high in zip(joints, self.lower_rad, self.upper_rad, strict=True):
            turned = angle + 2 * np.pi * np.arange(-2, 3)
            choices.append(turned[(low - turned <= LIMIT_SLACK_RAD) & (turned - high <= LIMIT_SLACK_RAD)])
        return np.array(list(product(*choices)))


@dataclass(frozen=True)
class Arm(LimitedJoints):
    """Lengths in mm, limits in rad, axis speeds in rad/s, as published for the arm.

    `shoulder_forward_mm`, `shoulder_height_mm`: axis 2 from the base; `elbow_up_mm`: axis 4 above axis 3.
    `row`: the line that describes an arm of one's own; empty for a listed arm.
    """

    name: str
    shoulder_forward_mm: float
    shoulder_height_mm: float
    lower_arm_mm: float
    elbow_up_mm: float
    forearm_mm: float
    flange_mm: float
    lower_rad: tuple[float, ...]
    upper_rad: tuple[float, ...]
    speed_rad_s: tuple[float, ...]
    row: str = ""

    @property
    def identifier(self) -> str:
        """Text by which `find_arm` finds the arm again: its name, or its line."""
        return self.row or self.name

    @property
    def wrist_offset_mm(self) -> float:
        """Distance of axis 6 from axis 4: 0 for a spherical wrist."""
        return 0.0

    @property
    def wrist_to_flange_mm(self) -> float:
        """Distance of the flange from the point where axes 4 and 5 meet."""
        return float(np.hypot(self.flange_mm, self.wrist_offset_mm))

    @cached_property
    def _elbow_to_wrist(self) -> tuple[float, float]:
        """Length of elbow to wrist centre, and its angle from the vertical at home."""
        return float(np.hypot(self.forearm_mm, self.elbow_up_mm)), float(np.arctan2(self.forearm_mm, self.elbow_up_mm))

    def forward(self, joints_rad: ArrayLike) -> Array:
        """base_T_flange (..., 4, 4) of joints (..., 6)."""
        q = checked_joints(joints_rad)
        rotation = self._wrist_rotation(q) @ rotation_x(q[..., 5]) @ TOOL0_IN_AXIS_6
        return transform(rotation, self.skeleton(q)[..., 3, :])

    def skeleton(self, joints_rad: ArrayLike) -> Array:
        """Shoulder (axis 2), elbow (axis 3), wrist centre and flange in the base (..., 4, 3) mm."""
        q = checked_joints(joints_rad)
        reach, rest = self._elbow_to_wrist
        bend = q[..., 1] + q[..., 2]
        forward = np.full(q.shape[:-1], self.shoulder_forward_mm)
        up = np.full(q.shape[:-1], self.shoulder_height_mm)
        plane = np.stack(
            [
                np.stack([forward, up], -1),
                np.stack(
                    [forward + self.lower_arm_mm * np.sin(q[..., 1]), up + self.lower_arm_mm * np.cos(q[..., 1])], -1
                ),
            ],
            -2,
        )
        wrist = plane[..., 1, :] + reach * np.stack([np.sin(rest + bend), np.cos(rest + bend)], -1)
        plane = np.concatenate([plane, wrist[..., None, :]], -2)
        c, s = np.cos(q[..., :1]), np.sin(q[..., :1])
        points = np.stack([plane[..., 0] * c, plane[..., 0] * s, plane[..., 1]], -1)
        to_flange = self._wrist_rotation(q) @ np.array([self.flange_mm, 0.0, self.wrist_offset_mm])
        return np.concatenate([points, (points[..., 2, :] + to_flange)[..., None, :]], -2)

    def _wrist_rotation(self, q: Array) -> Array:
        """Orientation (..., 3, 3) behind axis 5: axis 6, axis 5, and what is up with all joints at zero."""
        return rotation_z(q[..., 0]) @ rotation_y(q[..., 1] + q[..., 2]) @ rotation_x(q[..., 3]) @ rotation_y(q[..., 4])

    def branches(
        self, base_T_flange: ArrayLike, near_rad: ArrayLike | None = None, singular: float = SINGULAR_EXACT
    ) -> Array:
        """All eight closed-form solutions (..., 8, 6) of poses (..., 4, 4), row = cfx, angles in (-pi, pi].

        Joint limits are ignored; rows out of reach are NaN. Where the wrist is straight (sine of axis 5 below
        `singular`) or the wrist centre lies on axis 1, the free joint is taken from `near_rad` (default zeros).
        """
        pose = checked_poses(base_T_flange)
        near = np.zeros(6) if near_rad is None else checked_joints(near_rad)
        wrist = pose[..., :3, 3] - self.flange_mm * pose[..., :3, 2]
        q1, q2, q3 = self._positioning(wrist, near)
        base_R_forearm = rotation_z(q1) @ rotation_y(q2 + q3)
        tool = pose[..., None, :3, :3] @ TOOL0_IN_AXIS_6.T
        m = np.swapaxes(base_R_forearm, -1, -2) @ tool  # Rx(q4) Ry(q5) Rx(q6)
        free = np.hypot(m[..., 1, 0], m[..., 2, 0]) < singular
        q4 = np.where(free, near[..., None, 3], np.arctan2(_WRIST * m[..., 1, 0], -_WRIST * m[..., 2, 0]))
        n = np.swapaxes(rotation_x(q4), -1, -2) @ m  # Ry(q5) Rx(q6): the rest is exact even where q4 is free
        q5 = np.arctan2(-n[..., 2, 0], n[..., 0, 0])
        q6 = np.arctan2(-n[..., 1, 2], n[..., 1, 1])
        return wrap(np.stack([q1, q2, q3, q4, q5, q6], -1))

    def _positioning(self, wrist: Array, near: Array) -> tuple[Array, Array, Array]:
        """Axes 1 to 3 (..., 8) rad for a wrist centre (..., 3) mm; NaN where it is out of reach."""
        reach, rest = self._elbow_to_wrist
        radius = np.hypot(wrist[..., 0], wrist[..., 1])[..., None]
        azimuth = np.where(radius < 1e-9, near[..., :1], np.arctan2(wrist[..., 1], wrist[..., 0])[..., None])
        q1 = azimuth + np.where(_FRONT > 0, 0.0, np.pi)
        forward = _FRONT * radius - self.shoulder_forward_mm
        up = (wrist[..., 2] - self.shoulder_height_mm)[..., None]
        cosine = (forward**2 + up**2 - self.lower_arm_mm**2 - reach**2) / (2 * self.lower_arm_mm * reach)
        bend = _ELBOW * np.arccos(np.clip(cosine, -1.0, 1.0))
        bend = np.where(np.abs(cosine) > 1.0 + 1e-12, np.nan, bend)
        q2 = np.arctan2(forward, up) - np.arctan2(reach * np.sin(bend), self.lower_arm_mm + reach * np.cos(bend))
        return q1, q2, bend - rest

    def inverse(self, base_T_flange: ArrayLike, near_rad: ArrayLike | None = None) -> Array:
        """Every joint vector (n, 6), n >= 1, within the limits, with every possible number of whole turns.

        Raises OutOfReach or OutsideJointLimits when there is none.
        """
        return self._within_limits(np.asarray(base_T_flange, float), near_rad, SINGULAR_EXACT)

    def nearest(self, base_T_flange: ArrayLike, joints_now_rad: ArrayLike) -> Array:
        """The solution (6,) with the smallest largest joint travel from `joints_now_rad` (6,). Raises as `inverse`."""
        now = checked_joints(joints_now_rad)
        solutions = self._within_limits(np.asarray(base_T_flange, float), now, SINGULAR_ON_THE_WIRE)
        best: Array = solutions[np.argmin(np.abs(solutions - now).max(-1))]
        return best

    def nearest_to_range(self, base_T_flange: ArrayLike, lowest_rad: Array, highest_rad: Array) -> Array:
        """The solution (6,) least outside a range of joints, over half of the range of each. Raises as `inverse`."""
        middle = (lowest_rad + highest_rad) / 2
        half = np.maximum((highest_rad - lowest_rad) / 2, MIN_RANGE_RAD)
        solutions = self.inverse(base_T_flange, middle)
        best: Array = solutions[np.argmin((np.abs(solutions - middle) / half).max(axis=1))]
        return best

    def matching(
        self, base_T_flange: ArrayLike, configuration: tuple[int, int, int, int], near_rad: ArrayLike | None = None
    ) -> Array:
        """The solution (6,) in that configuration (cf1, cf4, cf6, cfx); nearest to `near_rad` where several qualify.

        Raises as `inverse`, and OtherConfiguration when the pose is only reachable in another configuration.
        """
        wanted, near = _checked(configuration), np.zeros(6)
        near[[0, 3, 5]] = (np.array(wanted[:3]) + 0.5) * np.pi / 2  # the middle of the quarters
        near = near if near_rad is None else checked_joints(near_rad)
        fitting = self._all_matching(np.asarray(base_T_flange, float), wanted, near)
        best: Array = fitting[np.argmin(np.abs(fitting - near).max(-1))]
        return best

    def all_matching(
        self, base_T_flange: ArrayLike, configuration: tuple[int, int, int, int], near_rad: ArrayLike
    ) -> Array:
        """The solutions (n, 6) in that configuration, of which the controller takes one. Raises as `matching`.

        Rarely more than one: with a straight wrist only the sum of axes 4 and 6 is determined, and there is one for
        every 5° of axis 4 within its quarter turn.
        """
        wanted, near, pose = _checked(configuration), checked_joints(near_rad), np.asarray(base_T_flange, float)
        found = [self._all_matching(pose, wanted, near)]
        if np.abs(np.sin(found[0][:, 4])).min() < SINGULAR_ON_THE_WIRE:
            for axis_4 in (wanted.cf4 + np.linspace(0.0, 1.0, STRAIGHT_WRIST_SAMPLES)) * np.pi / 2:
                with suppress(UnreachablePoseError):
                    found.append(self._all_matching(pose, wanted, np.array([*near[:3], axis_4, *near[4:]])))
        return np.concatenate(found)

    def _all_matching(self, base_T_flange: Array, wanted: Configuration, near: Array) -> Array:
        """The solutions (n, 6), n >= 1, in that configuration; a free joint is as in `near`. Raises as `matching`."""
        return self._of_configuration(self._within_limits(base_T_flange, near, SINGULAR_ON_THE_WIRE), wanted)

    def singularity_clearance(self, joints_rad: ArrayLike) -> Array:
        """Distance (...) of joints (..., 6) from the nearest singularity: 0 on it, at most 1 (dimensionless).

        The smallest of |sin axis 5|, |sin| of the angle between lower arm and forearm, and the wrist centre's
        distance from axis 1 over the reach.
        """
        clearance: Array = np.abs(self._sides(checked_joints(joints_rad))).min(-1)
        return clearance

    @property
    def reach_mm(self) -> float:
        """Distance of the wrist centre from axis 1 with the arm stretched forward: the reach in the arm's name."""
        return self.shoulder_forward_mm + self.lower_arm_mm + self._elbow_to_wrist[0]

    def _sides(self, q: Array) -> Array:
        """Signed clearances (..., 3): wrist before axis 1, wrist before the lower arm, axis 5."""
        reach, rest = self._elbow_to_wrist
        bend = q[..., 1] + q[..., 2] + rest
        forward = self.shoulder_forward_mm + self.lower_arm_mm * np.sin(q[..., 1]) + reach * np.sin(bend)
        return np.stack([forward / self.reach_mm, np.sin(q[..., 2] + rest), np.sin(q[..., 4])], -1)

    def _has_configuration(self, joints: Array, wanted: Configuration) -> bool:
        return wanted.cfx in _CFX and super()._has_configuration(joints, wanted)

    def _within_limits(self, base_T_flange: Array, near_rad: ArrayLike | None, singular: float) -> Array:
        branches = self.branches(base_T_flange, near_rad, singular)
        if branches.ndim != 2:
            raise GeometryError(f"one pose (4, 4) expected, got {base_T_flange.shape}; use branches for stacks")
        reachable = branches[np.isfinite(branches).all(-1)]
        if not len(reachable):
            raise self._out_of_reach(base_T_flange)
        solutions = [turned for joints in reachable for turned in self._turns(joints)]
        if not solutions:
            turned = reachable[:, None] + 2 * np.pi * np.arange(-2, 3)[:, None]
            least = min(self._excess_rad(turned).min(1), key=np.max)
            raise OutsideJointLimits(self.name, int(least.argmax()) + 1, float(least.max()))
        return _distinct(np.array(solutions))

    def _wrist_centres(self, base_T_flange: Array) -> Array:
        """Where axes 4 and 5 may meet (n, 3) mm for a pose (4, 4)."""
        return np.array([base_T_flange[:3, 3] - self.flange_mm * base_T_flange[:3, 2]])

    def _out_of_reach(self, base_T_flange: Array) -> OutOfReach:
        wrists = self._wrist_centres(base_T_flange)
        reach, _ = self._elbow_to_wrist
        up = wrists[:, 2] - self.shoulder_height_mm
        radius = np.hypot(wrists[:, 0], wrists[:, 1])
        forward = np.stack([radius, -radius]) - self.shoulder_forward_mm
        distances = np.hypot(forward, up)
        beyond = distances.min(0) - (self.lower_arm_mm + reach)
        inside = abs(self.lower_arm_mm - reach) - distances.max(0)
        nearest = int(np.maximum(beyond, inside).argmin())
        far, near = float(beyond[nearest]), float(inside[nearest])
        return OutOfReach(self.name, max(far, near), too_near=near > far)


def checked_joints(joints_rad: ArrayLike, axes: int = 6) -> Array:
    """Joints (..., axes). Raises GeometryError."""
    joints = np.asarray(joints_rad, float)
    if joints.shape[-1:] != (axes,):
        raise GeometryError(f"joints must be (..., {axes}) in rad, got shape {joints.shape}")
    if not np.all(np.isfinite(joints)):
        raise GeometryError("joints must be finite")
    return joints


def checked_poses(base_T_flange: ArrayLike) -> Array:
    """Poses (..., 4, 4). Raises GeometryError."""
    pose = np.asarray(base_T_flange, float)
    if pose.shape[-2:] != (4, 4):
        raise GeometryError(f"base_T_flange must be (..., 4, 4), got shape {pose.shape}")
    if not np.all(np.isfinite(pose)):
        raise GeometryError("base_T_flange must be finite")
    rotation = pose[..., :3, :3]
    off = np.abs(rotation @ np.swapaxes(rotation, -1, -2) - np.eye(3)).max(initial=0.0)
    if off > RIGID_TOLERANCE or np.any(np.linalg.det(rotation) < 0):
        raise GeometryError(f"base_T_flange holds no rotation (off by {off:.3g}, or mirrored): normalise it first")
    return pose


def _checked(configuration: tuple[int, ...]) -> Configuration:
    if len(configuration) != 4:
        raise GeometryError(f"confdata has four numbers (cf1, cf4, cf6, cfx), got {len(configuration)}")
    return Configuration(*configuration)


def _distinct(solutions: Array) -> Array:
    """The rows (n, 6) without repetitions: at a singularity branches coincide."""
    _, first = np.unique(np.round(solutions, 9), axis=0, return_index=True)
    return solutions[np.sort(first)]
