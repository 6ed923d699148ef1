"""RAPID's robtarget besides the pose: unused external axes, frames and units."""

from collections.abc import Iterable

from calibration.kinematics.arm import Configuration
from calibration.transforms import Array
from drivers.interfaces import PoseReading

UNUSED_AXIS = 9e9
"""ABB's value for an external axis that does not exist."""
UNUSED_AXES = (UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS)
MIN_UNUSED_AXIS = 8.9e9
"""Axes at or above this do not exist: 9E9 is float32 8999999488 on the CB link, RWS prints 8.999999e+09 or 9E+09."""

POSE_CONVENTION = "tool0 in wobj0, in millimetres, with ABB's quaternion (q1, the scalar part, first)"


SEVEN = 7
"""Axes of an arm whose axis 7 stands as eax_a in a jointtarget, and whose arm angle stands there in a robtarget."""


def reading_of(
    base_T_flange: Array, quarters: Iterable[float], external: Iterable[float], axes: int, taken_at_s: float
) -> PoseReading:
    """A robtarget as a reading that does not say whether the arm stands. `axes`: 6, or 7 where eax_a is the arm angle.

    External axes that do not exist are exactly UNUSED_AXIS.
    """
    external_axes = tuple(UNUSED_AXIS if value >= MIN_UNUSED_AXIS else value for value in external)
    arm_angle_deg = None
    if axes >= SEVEN and external_axes[0] != UNUSED_AXIS:
        arm_angle_deg, external_axes = external_axes[0], (UNUSED_AXIS, *external_axes[1:])
    posture = Configuration(*map(int, quarters))
    return PoseReading(base_T_flange, posture, external_axes, False, taken_at_s, arm_angle_deg=arm_angle_deg)
