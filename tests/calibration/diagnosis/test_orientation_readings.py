"""Three numbers read in any convention are traced back to the one they were written in; SciPy writes and reads them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.diagnosis.angle_agreement import angles_between
from calibration.diagnosis.orientation_readings import READINGS, likely_readings, readings_of
from calibration.kinematics.conventions import ORDERS
from calibration.transforms import Array, rotation_angle_rad

EVERY_ORDER = [*ORDERS, *(order.lower() for order in ORDERS)]
"""In SciPy's notation: intrinsic in capitals, extrinsic in small letters."""


def random_rotations(seed: int, n: int = 12) -> Array:
    """(n, 3, 3) of a flange that looks down, tilted by up to a radian and turned by any angle."""
    rng = np.random.default_rng(seed)
    down = Rotation.from_rotvec([np.pi, 0, 0])
    tilts = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, (n, 3)))
    turns = Rotation.from_rotvec(np.outer(rng.uniform(-2.5, 2.5, n), [0, 0, 1]))
    rotations: Array = (tilts * down * turns).as_matrix()
    return rotations


def is_traced(read: Array, true: Array) -> bool:
    """Whether one of the likely readings restores the rotations."""
    likely = likely_readings(read, angles_between(true))
    turns = [np.swapaxes(one.rotations, 1, 2) @ true[one.rows] for one in likely]
    return any(float(np.max(rotation_angle_rad(turn))) < 1e-6 for turn in turns)


@pytest.mark.slow
@pytest.mark.parametrize(("at", "read"), list(enumerate(ORDERS)))
def test_every_order_is_traced_back(at: int, read: str) -> None:
    """A quarter of the orders with each, which is every order with three others."""
    true = random_rotations(3)
    lost = [
        written
        for written in EVERY_ORDER[at % 4 :: 4]
        if written != read
        and not is_traced(Rotation.from_euler(read, Rotation.from_matrix(true).as_euler(written)).as_matrix(), true)
    ]
    assert lost == []


@pytest.mark.parametrize("order", EVERY_ORDER[::5])
def test_vectors_and_angles_for_each_other(order: str) -> None:
    true = random_rotations(4)
    assert is_traced(Rotation.from_euler(order, Rotation.from_matrix(true).as_rotvec()).as_matrix(), true)
    assert is_traced(Rotation.from_rotvec(Rotation.from_matrix(true).as_euler(order)).as_matrix(), true)


def test_there_are_as_many_readings_as_are_counted() -> None:
    assert sum(1 for _ in readings_of(random_rotations(6))) == READINGS


def test_gimbal_lock_leaves_a_view_out() -> None:
    true = random_rotations(7)
    true[3] = Rotation.from_euler("ZYX", [0.3, np.pi / 2, 0.2]).as_matrix()
    misread = true.copy()
    others = np.arange(len(true)) != 3
    numbers = Rotation.from_matrix(true[others]).as_euler("XYZ")
    misread[others] = Rotation.from_euler("ZYX", numbers).as_matrix()
    (first, *_) = likely_readings(misread, angles_between(true))
    assert 3 not in first.rows
