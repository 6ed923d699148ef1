"""Numbers and angles as other systems write them."""

import math

import numpy as np

from calibration.transforms import Array


def fixed(value: float, decimals: int) -> str:
    """`value` with that many decimals, never as minus zero."""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def single(value: float) -> str:
    """`value` as a single float, RAPID's num: nine digits, which restore its every bit."""
    return f"{float(np.float32(value)) + 0.0:.9g}"


def angles_xyz(rotation: Array) -> tuple[float, float, float]:
    """Turns (x, y, z) in rad about fixed axes, x first: R = Rz(z) Ry(y) Rx(x), y in [-pi/2, pi/2].

    Where y is a quarter turn x and z are about one axis: z is then about 0, and x holds the sum. Either way the three
    angles give R back, for x is found after the turn about z is taken away.
    """
    r = rotation
    z = math.atan2(r[1, 0], r[0, 0])
    cosine, sine = math.cos(z), math.sin(z)
    y = math.atan2(-r[2, 0], cosine * r[0, 0] + sine * r[1, 0])
    x = math.atan2(sine * r[0, 2] - cosine * r[1, 2], cosine * r[1, 1] - sine * r[0, 1])
    return x, y, z


def angles_zyx(rotation: Array) -> tuple[float, float, float]:
    """Turns (x, y, z) in rad about moving axes, x first: R = Rx(x) Ry(y) Rz(z), y in [-pi/2, pi/2]."""
    x, y, z = angles_xyz(rotation.T)
    return -x, -y, -z
