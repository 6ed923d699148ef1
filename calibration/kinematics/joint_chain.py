"""Six turning joints, each with a frame of its own, as URDF and Denavit-Hartenberg tables describe an arm."""

from dataclasses import dataclass

import numpy as np

from calibration.errors import GeometryError
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_row import with_wrist_offset
from calibration.transforms import Array, rotation_angle_rad, rotation_from_vector, transform

MAX_OFFSET_MM = 0.01
"""Axes that miss each other by more than this do not meet."""
MAX_TILT_RAD = 1e-4
"""Directions that differ by more than this are not parallel."""

_AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]], float)
"""Directions of ABB's axes 1 to 6 in the base with all joints at zero."""
COMPARED_POSES = 64


@dataclass(frozen=True)
class JointChain:
    """Joint k turns by its angle about the unit vector `axes[k]`, after `parent_T_joint[k]`; `last_T_flange` follows.

    `parent_T_joint` (6, 4, 4) mm, `axes` (6, 3), `last_T_flange` (4, 4) mm.
    """

    parent_T_joint: Array
    axes: Array
    last_T_flange: Array

    def forward(self, joints_rad: Array) -> Array:
        """base_T_flange (4, 4) of joints (6,)."""
        base_T_link = np.eye(4)
        for frame, axis, angle in zip(self.parent_T_joint, self.axes, joints_rad, strict=True):
            base_T_link = base_T_link @ frame @ transform(rotation_from_vector(angle * axis), np.zeros(3))
        return base_T_link @ self.last_T_flange

    def axes_at_zero(self) -> tuple[Array, Array]:
        """A point (6, 3) mm on each axis and its direction (6, 3) in the base, with all joints at zero."""
        base_T_joint, frame = np.empty((6, 4, 4)), np.eye(4)
        for place, parent_T_joint in enumerate(self.parent_T_joint):
            base_T_joint[place] = frame = frame @ parent_T_joint
        return base_T_joint[:, :3, 3], np.einsum("nij,nj->ni", base_T_joint[:, :3, :3], self.axes)


def arm_of_chain(chain: JointChain, name: str, limits_rad: Array, speeds_rad_s: tuple[float, ...]) -> Arm:
    """The chain as an arm with ABB's six lengths. `limits_rad` (6, 2).

    Raises GeometryError that names the first property which such an arm must have and this one lacks: directions of
    the axes at zero, an upright lower arm, axes 4 and 5 through one point, axis 6 beside axis 4, tool0 on the flange.
    """
    points, directions = chain.axes_at_zero()
    for place, (direction, expected) in enumerate(zip(directions, _AXES, strict=True)):
        if np.linalg.norm(direction - expected) > MAX_TILT_RAD:
            raise GeometryError(
                f"{name}: axis {place + 1} at zero points along {_vector(direction)} in the base, not along "
                f"{_vector(expected)}: ABB's zero has the lower arm upright and the forearm straight ahead"
            )
    shoulder, elbow, forearm, wrist, last = points[1], points[2], points[3], points[4], points[5]
    flange = chain.forward(np.zeros(6))
    _require(name, "axis 1 passes the base's origin by", float(np.hypot(*points[0, :2])))
    _require(name, "the lower arm leans forward by", abs(elbow[0] - shoulder[0]))
    _require(name, "axis 4 runs beside axis 1 by", abs(forearm[1]))
    _require(name, "axis 5 passes axis 4 by", abs(wrist[2] - forearm[2]))
    _require(name, "axis 6 runs beside axis 4 by", abs(last[1] - forearm[1]))
    _require(name, "the flange is beside axis 6 by", float(np.hypot(*(flange[:3, 3] - last)[1:])))
    low, high = limits_rad.T
    arm = Arm(
        name,
        shoulder_forward_mm=float(shoulder[0]),
        shoulder_height_mm=float(shoulder[2]),
        lower_arm_mm=float(elbow[2] - shoulder[2]),
        elbow_up_mm=float(forearm[2] - elbow[2]),
        forearm_mm=float(wrist[0] - elbow[0]),
        flange_mm=float(flange[0, 3] - wrist[0]),
        lower_rad=tuple(low.tolist()),
        upper_rad=tuple(high.tolist()),
        speed_rad_s=speeds_rad_s,
    )
    offset_mm = float(last[2] - forearm[2])
    arm = with_wrist_offset(arm, offset_mm if abs(offset_mm) > MAX_OFFSET_MM else 0.0)
    _compare(arm, chain, limits_rad)
    return arm


def _compare(arm: Arm, chain: JointChain, limits_rad: Array) -> None:
    """Raise GeometryError when the arm and the chain differ anywhere within the limits."""
    joints = np.random.default_rng(0).uniform(limits_rad[:, 0], limits_rad[:, 1], (COMPARED_POSES, 6))
    drawn = np.array([chain.forward(each) for each in joints])
    off = np.linalg.inv(arm.forward(joints)) @ drawn
    turned = float(np.degrees(rotation_angle_rad(off[:, :3, :3])).max())
    apart = float(np.linalg.norm(off[:, :3, 3], axis=1).max())
    if apart > MAX_OFFSET_MM or turned > np.degrees(MAX_TILT_RAD):
        raise GeometryError(
            f"{arm.name}: its flange is up to {apart:.2f} mm and {turned:.2f} deg from tool0 of an ABB arm: "
            "the last frame has its origin on the flange, z out of it, and x down at zero"
        )


def _require(name: str, what: str, offset_mm: float) -> None:
    if offset_mm > MAX_OFFSET_MM:
        raise GeometryError(
            f"{name}: {what} {offset_mm:.2f} mm: only arms whose axes 4 and 5 meet are known by their lengths "
            "(leave the model out; everything but planning, reach and posture works)"
        )


def _vector(values: Array) -> str:
    return f"({', '.join(f'{value + 0.0:.3g}' for value in np.round(values, 4))})"
