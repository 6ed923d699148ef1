"""The pose by the arm's axes against the reported one: what differs is named with its size and likely cause."""

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.transforms import Array, transform
from daemon.cell.frame_check import frame_difference
from drivers.interfaces import PoseReading

ARM = find_arm("IRB 1600-6/1.45")
JOINTS = np.radians([20.0, 10.0, 5.0, 30.0, 50.0, -40.0])
UNUSED = (9e9,) * 6


def tilted(degrees: float) -> Array:
    angle = np.radians(degrees)
    return np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])


@pytest.mark.parametrize(
    ("world_T_base", "external", "size", "cause"),
    [
        (transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 2500.0]), UNUSED, "180.0 deg", "hangs upside down"),
        (transform(tilted(30.0), [0.0, 0.0, 500.0]), UNUSED, "30.0 deg", "tilted by 30 deg"),
        (transform(np.eye(3), [0.0, 0.0, 700.0]), UNUSED, "700 mm and 0.0 deg", "a pedestal"),
        (transform(np.eye(3), [1200.0, 0.0, 0.0]), (1200.0, *UNUSED[1:]), "1200 mm", "rides on a track"),
    ],
    ids=["upside down", "tilted", "pedestal", "track"],
)
def test_a_difference_is_named_with_its_size_and_likely_cause(
    world_T_base: Array, external: tuple[float, ...], size: str, cause: str
) -> None:
    reading = PoseReading(world_T_base @ ARM.forward(JOINTS), (0, 0, 0, 0), external, still=True, taken_at_s=0.0)
    found = frame_difference(ARM, JOINTS, reading)
    assert not found.agrees
    assert size in found.what
    assert cause in found.what
    assert "base_frame" in found.fix
    np.testing.assert_allclose(found.reported_T_base, world_T_base, atol=1e-9)


def test_a_calibrated_arm_agrees() -> None:
    off = transform(tilted(0.1), [0.6, -0.5, 0.4])
    found = frame_difference(ARM, JOINTS, PoseReading(ARM.forward(JOINTS) @ off, (0, 0, 0, 0), UNUSED, True, 0.0))
    assert found.agrees
    assert found.what == ""
