"""RAPID's robtarget besides the pose: unused external axes, frames and units."""

UNUSED_AXIS = 9e9
"""ABB's value for an external axis that does not exist."""
UNUSED_AXES = (UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS, UNUSED_AXIS)
MIN_UNUSED_AXIS = 8.9e9
"""Axes at or above this do not exist: 9E9 is float32 8999999488 on the CB link, RWS prints 8.999999e+09 or 9E+09."""

POSE_CONVENTION = "tool0 in wobj0, in millimetres, with ABB's quaternion (q1, the scalar part, first)"


SEVEN = 7
"""Axes of an arm whose axis 7 stands as eax_a in a jointtarget, and whose arm angle stands there in a robtarget."""


def external_axis(value: float) -> float:
    """`value`, or exactly UNUSED_AXIS for an axis that does not exist."""
    return UNUSED_AXIS if value >= MIN_UNUSED_AXIS else value


def split_arm_angle(external_axes: tuple[float, ...], axes: int) -> tuple[float | None, tuple[float, ...]]:
    """Arm angle in degrees and external axes of a robtarget, for an arm with so many axes; None for six axes."""
    if axes < SEVEN or external_axes[0] == UNUSED_AXIS:
        return None, external_axes
    return external_axes[0], (UNUSED_AXIS, *external_axes[1:])
