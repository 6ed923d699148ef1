"""A camera that repeats itself is told; one that has no noise, or sees nothing, is not accused."""

from dataclasses import replace

import numpy as np
import pytest

from daemon.cell.cell import StaleCaptureDetector
from daemon.errors import StaleCaptureError
from drivers.interfaces import CameraFrame
from tests.daemon.fakes import pose_reading

HERE, NEAR, ELSEWHERE, TURNED = pose_reading(0), pose_reading(0.5), pose_reading(2), pose_reading(turn_deg=1)
VIEW = CameraFrame(np.arange(12, dtype=np.uint8).reshape(3, 4), 0.0)


@pytest.mark.parametrize("then", [ELSEWHERE, TURNED])
def test_the_same_picture_from_another_pose_is_reported(then) -> None:
    novelty = StaleCaptureDetector("camera")
    novelty.check_frame(VIEW, HERE)
    with pytest.raises(StaleCaptureError, match="the camera sent the same picture again"):
        novelty.check_frame(replace(VIEW, taken_at_s=9.0), then)


def test_one_grey_value_makes_a_picture_new() -> None:
    novelty = StaleCaptureDetector("camera")
    novelty.check_frame(VIEW, HERE)
    other = VIEW.image.copy()
    other[2, 3] += 1
    novelty.check_frame(CameraFrame(other, 1.0), ELSEWHERE)


def test_from_the_same_place_a_drawn_picture_may_be_the_same() -> None:
    novelty = StaleCaptureDetector("camera")
    novelty.check_frame(VIEW, HERE)
    novelty.check_frame(VIEW, NEAR)


def test_darkness_looks_alike_from_everywhere() -> None:
    novelty = StaleCaptureDetector("camera")
    for pose in (HERE, ELSEWHERE):
        novelty.check_frame(CameraFrame(np.zeros((3, 4), np.uint8), 0.0), pose)


def test_the_same_cloud_from_another_pose_is_reported() -> None:
    novelty = StaleCaptureDetector("scanner")
    cloud = b"ply"
    novelty.check(cloud, "cloud", HERE)
    with pytest.raises(StaleCaptureError, match="captures anew for each request"):
        novelty.check(cloud, "cloud", ELSEWHERE)
