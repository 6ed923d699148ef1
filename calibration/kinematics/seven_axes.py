"""Kinematics of ABB's arm with seven axes, the single-arm YuMi IRB 14050, millimetres and radians.

From the base outwards the axes are 1, 2, 7, 3, 4, 5, 6, in ABB's numbers; joints (7,) stand in the order of the
numbers. A controller reports axis 7 as the external axis eax_a of a jointtarget, and the arm angle as that of a
robtarget. The arm angle is the one of L. Elias and J. Wen, "Redundancy Parameterization of the ABB YuMi Robot Arm",
which agrees with RobotStudio. There is no closed form for the joints of a pose: Newton's method from many starts.
"""

from contextlib import suppress
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from calibration.kinematics.arm import (
    LIMIT_SLACK_RAD,
    TOOL0_IN_AXIS_6,
    Arm,
    Configuration,
    LimitedJoints,
    OutOfReach,
    OutsideJointLimits,
    UnreachablePoseError,
    checked_joints,
    checked_poses,
)
from calibration.kinematics.axis_rotations import rotation_x, rotation_y, rotation_z, wrap
from calibration.transforms import Array, transform, vector_from_rotation

AXES = 7
OUTWARDS = np.array([0, 1, 6, 2, 3, 4, 5])
"""Axes from the base outwards, as indices of joints (7,)."""
_TURNS = (rotation_z, rotation_y, rotation_z, rotation_y, rotation_x, rotation_y, rotation_x)
_DIRECTIONS = np.eye(3)[[2, 1, 2, 1, 0, 1, 0]]

STEPS = 20
"""Of Newton's method; from most starts it converges in 5 to 15."""
MAX_STEP_RAD = 0.5
LEVER_MM = 300.0
"""A rotation error counts as that of a point so far from the flange."""
CONVERGED = 1e-9
STARTS_PER_AXIS = (3, 2, 3, 2, 2, 2, 3)
"""Angles of axes 1 to 7 from which joints are sought: 432 starts."""


@dataclass(frozen=True)
class SevenAxisArm(LimitedJoints):
    """`links_mm` (7, 3): from the base to the first axis, then from each to the next outwards, all joints zero.

    `flange_mm`: from axis 6 along it to the flange.
    Limits in rad and axis speeds in rad/s in the order of the axes' numbers.
    """

    name: str
    links_mm: tuple[tuple[float, float, float], ...]
    flange_mm: float
    lower_rad: tuple[float, ...]
    upper_rad: tuple[float, ...]
    speed_rad_s: tuple[float, ...]

    @property
    def identifier(self) -> str:
        """Text by which `find_any_arm` finds the arm again."""
        return self.name

    @property
    def reach_mm(self) -> float:
        """Distance of axis 5 from axis 2 with the arm stretched."""
        return float(np.abs(np.array(self.links_mm)[2:6]).sum())

    def forward(self, joints_rad: ArrayLike) -> Array:
        """base_T_flange (..., 4, 4) of joints (..., 7)."""
        points, _, rotation = self._chain(checked_joints(joints_rad, AXES))
        return transform(rotation @ TOOL0_IN_AXIS_6, points[..., AXES, :])

    def skeleton(self, joints_rad: ArrayLike) -> Array:
        """Axes 2, 3 and 5 and the flange in the base (..., 4, 3) mm."""
        points, _, _ = self._chain(checked_joints(joints_rad, AXES))
        drawn: Array = points[..., [1, 3, 5, AXES], :]
        return drawn

    def arm_angle_rad(self, joints_rad: ArrayLike) -> Array:
        """Arm angle (...) of joints (..., 7): of axis 3 about the line from axis 1 to axis 6, against the base's z.

        Where MOC.cfg names y as the arm angle's reference direction, the controller reports another number.
        """
        points, directions, _ = self._chain(checked_joints(joints_rad, AXES))
        return _arm_angle(points, directions)

    def nearest(self, base_T_flange: ArrayLike, joints_now_rad: ArrayLike) -> Array:
        """Joints (7,) within the limits, from `joints_now_rad` (7,) with the least turning of all axes together.

        Raises OutOfReach or OutsideJointLimits.
        """
        now, pose = checked_joints(joints_now_rad, AXES), checked_poses(base_T_flange)
        with suppress(UnreachablePoseError):
            return _nearest(self._within_limits(self._solve(pose, now[None], None)), now)
        return _nearest(self._within_limits(self._solve(pose, self._starts(), None)), now)

    def matching(
        self,
        base_T_flange: ArrayLike,
        arm_angle_rad: float,
        configuration: tuple[int, int, int, int],
        near_rad: ArrayLike,
    ) -> Array:
        """The joints (7,) with that arm angle and configuration, within the limits.

        Newton's method from `near_rad`, then from 432 other starts, of whose results the nearest: joints may be
        missed. Raises OutOfReach, OutsideJointLimits, OtherConfiguration.
        """
        near, pose, wanted = checked_joints(near_rad, AXES), checked_poses(base_T_flange), Configuration(*configuration)
        with suppress(UnreachablePoseError):
            found = self._within_limits(self._solve(pose, near[None], arm_angle_rad))
            return _nearest(self._of_configuration(found, wanted), near)
        found = self._within_limits(self._solve(pose, self._starts(), arm_angle_rad))
        return _nearest(self._of_configuration(found, wanted), near)

    def _sides(self, q: Array) -> Array:
        """Axes 2, 3 and 5: the mock's own, since no source was found for what ABB's cfx means for seven axes."""
        sides: Array = q[..., [1, 2, 4]]
        return sides

    def _chain(self, q: Array) -> tuple[Array, Array, Array]:
        """Points (..., 8, 3) of the axes outwards and the flange, the axes' directions (..., 7, 3), last rotation."""
        rotation = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
        point = np.zeros((*q.shape[:-1], 3))
        points, directions = [], []
        for axis, link, turn, direction in zip(OUTWARDS, self.links_mm, _TURNS, _DIRECTIONS, strict=True):
            point = point + rotation @ np.array(link)
            points.append(point)
            directions.append(rotation @ direction)
            rotation = rotation @ turn(q[..., axis])
        points.append(point + rotation @ np.array([self.flange_mm, 0.0, 0.0]))
        return np.stack(points, -2), np.stack(directions, -2), rotation

    def _starts(self) -> Array:
        """Joints (n, 7) spread over the ranges of the axes."""
        angles = [
            low + (high - low) * (np.arange(count) + 0.5) / count
            for low, high, count in zip(self.lower_rad, self.upper_rad, STARTS_PER_AXIS, strict=True)
        ]
        return np.array(list(product(*angles)))

    def _solve(self, pose: Array, starts: Array, arm_angle_rad: float | None) -> Array:
        """Joints (k, 7) at the pose (4, 4), and with the arm angle, to which Newton's method leads; limits ignored."""
        q, found = starts.copy(), []
        for _ in range(STEPS):
            error, slope = self._errors(pose, q, arm_angle_rad)
            size = np.linalg.norm(error, axis=-1)
            done = size < CONVERGED
            found.append(q[done])
            q, error, slope, size = q[~done], error[~done], slope[~done], size[~done]
            if not len(q):
                break
            damping = np.minimum(size**2, 1e-2)[:, None, None] * np.eye(error.shape[-1])
            across = np.swapaxes(slope, -1, -2)
            step = (across @ np.linalg.solve(slope @ across + damping, error[..., None]))[..., 0]
            q = q - step * np.minimum(1.0, MAX_STEP_RAD / np.maximum(np.abs(step).max(-1), 1e-12))[:, None]
        return np.concatenate(found)

    def _errors(self, pose: Array, q: Array, arm_angle_rad: float | None) -> tuple[Array, Array]:
        """Errors (n, 6 or 7) of joints (n, 7), and their derivatives (n, 6 or 7, 7)."""
        points, directions, rotation = self._chain(q)
        turned = vector_from_rotation(rotation @ TOOL0_IN_AXIS_6 @ pose[:3, :3].T)
        error = np.concatenate([(points[:, AXES] - pose[:3, 3]) / LEVER_MM, turned], -1)
        levers = np.cross(directions, points[:, AXES, None] - points[:, :AXES]) / LEVER_MM
        slope = np.empty((len(q), 6, AXES))
        slope[:, :3, OUTWARDS] = np.swapaxes(levers, -1, -2)
        slope[:, 3:, OUTWARDS] = np.swapaxes(directions, -1, -2)
        if arm_angle_rad is None:
            return error, slope
        angle, step = _arm_angle(points, directions), 1e-6
        moved = [self._chain(q + step * axis)[:2] for axis in np.eye(AXES)]
        tilt = np.stack([wrap(_arm_angle(*each) - angle) / step for each in moved], -1)
        off = wrap(angle - arm_angle_rad)
        return np.concatenate([error, off[:, None]], -1), np.concatenate([slope, tilt[:, None]], -2)

    def _within_limits(self, found: Array) -> Array:
        """Those of joints (n, 7) within the limits, whole turns added where needed. Raises UnreachablePoseError."""
        if not len(found):
            raise OutOfReach(self.name, 0.0, too_near=False)
        middle = (np.array(self.lower_rad) + np.array(self.upper_rad)) / 2
        wrapped = middle + wrap(found - middle)
        least = self._excess_rad(wrapped)
        turned = [self._turns(joints) for joints in wrapped[least.max(-1) <= LIMIT_SLACK_RAD]]
        if not turned:
            best = least[least.max(-1).argmin()]
            raise OutsideJointLimits(self.name, int(best.argmax()) + 1, float(best.max()))
        return np.concatenate(turned)


AnyArm = Arm | SevenAxisArm


def _nearest(found: Array, near: Array) -> Array:
    """Of joints (n, 7) those with the least turning of all axes together."""
    nearest: Array = found[np.linalg.norm(found - near, axis=-1).argmin()]
    return nearest


def _arm_angle(points: Array, directions: Array) -> Array:
    """Arm angle (...) of a chain: of axis 3 about the line from the base of axis 1 to the base of axis 6."""
    line = points[..., AXES - 1, :] - points[..., 0, :]
    line = line / np.linalg.norm(line, axis=-1, keepdims=True)
    across, elbow = np.cross(line, np.array([0.0, 0.0, 1.0])), directions[..., 3, :]
    angle: Array = np.arctan2(-np.sum(np.cross(line, across) * elbow, -1), -np.sum(across * elbow, -1))
    return angle


def _yumi() -> SevenAxisArm:
    """IRB 14050; docs/arms.md names the sources of the numbers."""
    limits_deg = np.array(
        [(-168.5, 168.5), (-143.5, 43.5), (-123.5, 80), (-290, 290), (-88, 138), (-229, 229), (-168.5, 168.5)]
    )
    lower, upper = (tuple(float(angle) for angle in side) for side in np.radians(limits_deg).T)
    return SevenAxisArm(
        name="IRB 14050-0.5/0.5",
        links_mm=((0, 0, 306), (-30, 0, 0), (30, 0, 251.5), (40.5, 0, 0), (0, 0, 40.5), (265, 0, -27), (0, 0, 27)),
        flange_mm=36.0,
        lower_rad=lower,
        upper_rad=upper,
        speed_rad_s=tuple(float(speed) for speed in np.radians([180, 180, 180, 400, 400, 400, 180])),
    )


IRB_14050 = _yumi()
