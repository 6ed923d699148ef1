"""What a caller gives as points and poses either is that, or is refused: nothing is placed by another reading of it."""

from typing import Any

import numpy as np
import pytest

import handeyed
from calibration.errors import DocumentError
from calibration.transforms import rotation_from_vector, transform
from handeyed.arrays import as_points, as_pose
from tests.daemon.calibrations import a_calibration

POSE = transform(rotation_from_vector([0.3, -0.2, 0.1]), [500.0, 0.0, 800.0])
POINTS = np.arange(12.0).reshape(4, 3)


@pytest.mark.parametrize(
    ("given", "shape"),
    [
        (POINTS, (4, 3)),
        (POINTS.tolist(), (4, 3)),
        (np.asfortranarray(POINTS), (4, 3)),
        (POINTS.astype(">f4"), (4, 3)),
        (POINTS.astype(int), (4, 3)),
        (POINTS.reshape(2, 2, 3), (2, 2, 3)),
        ([1, 2, 3], (3,)),
        ([], (0, 3)),
        (np.zeros((0, 3)), (0, 3)),
    ],
)
def test_points(given: Any, shape: tuple[int, ...]) -> None:
    assert as_points(given).shape == shape
    assert as_points(given).ravel() == pytest.approx(np.arange(12.0) if np.size(given) == 12 else np.ravel(given))


def test_a_masked_point_is_none() -> None:
    points = as_points(np.ma.masked_greater(POINTS, 8.5))
    assert np.isnan(points).sum() == 3
    assert np.isnan(points[3]).all()


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (POINTS.T, r"an array \(3, 4\) holds no points: give \(n, 3\), a row for each point"),
        (np.zeros((3, 4)), "holds no points"),
        (np.zeros((2, 6)), "holds no points"),
        ([1.0, 2.0], "holds no points"),
        (5, "holds no points"),
        ("near", r"give \(n, 3\)"),
        ([[1, 2, 3], [4, 5]], r"give \(n, 3\)"),
    ],
)
def test_no_points(given: Any, why: str) -> None:
    with pytest.raises(DocumentError, match=why):
        as_points(given)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (POSE.T, r"an array \(4, 4\) that is no pose"),
        (POSE * np.nan, r"an array \(4, 4\) that is no pose"),
        (np.zeros((4, 4)), r"an array \(4, 4\) that is no pose"),
        (POSE @ np.diag([1, 1, -1, 1]), r"an array \(4, 4\) that is no pose"),
        (POSE @ np.diag([2, 2, 2, 1]), r"an array \(4, 4\) that is no pose"),
        (POSE[:3], r"an array \(3, 4\) that is no pose"),
        (POSE[None], "that is no pose"),
        ("now", r"give \(4, 4\)"),
    ],
)
def test_no_pose(given: Any, why: str) -> None:
    with pytest.raises(DocumentError, match=why):
        as_pose(given)


def test_nothing_is_registered_by_them() -> None:
    calibration = a_calibration("a")
    assert handeyed.register(POINTS, calibration, POSE).shape == (4, 3)
    for points, pose in [(POINTS.T, POSE), (POINTS, POSE.T)]:
        with pytest.raises(DocumentError):
            handeyed.register(points, calibration, pose)
