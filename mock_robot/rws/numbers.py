"""Formats numbers as the controller does: float32 with all its digits."""

import numpy as np

MIN_UNUSED_AXIS = 8.9e9
UNUSED_1, UNUSED_2 = "8.999999e+09", "9000000000"
"""9E9 as RobotWare 6 and 7.20 print it."""


def format_float(value: float) -> str:
    """Nine significant digits, which parse to the same float32."""
    return f"{float(np.float32(value)) + 0.0:.9g}"


def format_axis(value: float, unused: str) -> str:
    """Value of an external axis, or `unused` for an axis that does not exist."""
    return unused if value >= MIN_UNUSED_AXIS else format_float(value)
