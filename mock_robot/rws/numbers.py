"""Numbers as the controller prints them: a float32 with every digit it has."""

import numpy as np

UNUSED_FROM = 8.9e9
UNUSED_1, UNUSED_2 = "8.999999e+09", "9E+09"
"""How RobotWare 6 and 7 print 9E9."""


def printed(value: float) -> str:
    """Nine significant digits: parsed, they are the float32 again."""
    return f"{float(np.float32(value)) + 0.0:.9g}"


def printed_axis(value: float, unused: str) -> str:
    """An external axis, or the word for one that is not there."""
    return unused if value >= UNUSED_FROM else printed(value)
