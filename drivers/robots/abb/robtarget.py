"""RAPID's robtarget beside the pose: unused external axes, and the frames and units a pose is given in."""

UNUSED_AXIS = 9e9
"""ABB's value for an external axis that is not there."""
UNUSED_AXES = (UNUSED_AXIS,) * 6
MIN_UNUSED_AXIS = 8.9e9
"""An axis from here on is not there: 9E9 is float32 8999999488 on the CB link, RWS prints 8.999999e+09 or 9E+09."""

POSE_CONVENTION = "tool0 in wobj0, in millimetres, with ABB's quaternion (q1, the scalar part, first)"


def external_axis(value: float) -> float:
    """`value`, or exactly UNUSED_AXIS for an axis that is not there."""
    return UNUSED_AXIS if value >= MIN_UNUSED_AXIS else value
