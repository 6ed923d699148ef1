"""Clouds as clients send them, the poses they were taken from, and where their points lie in the base frame."""

import io

import numpy as np
import pytest

from calibration.transforms import Array, map_points, transform_from_quaternion
from tests.daemon.fakes import FLANGE_T_CAMERA

POSES = ("800,-100,900,0,1,0,0", "850,150,880,0,0.96,0.28,0")
"""base_T_flange as the query parameter `pose` has it: x, y, z mm, q1 to q4 (w first)."""
POSE = POSES[0]
PLY = {"content-type": "application/x-ply"}
OCTETS = {"content-type": "application/octet-stream"}
LAZ = {"content-type": "application/vnd.laszip"}


def cloud(points: int, seed: int = 3) -> Array:
    """Random points (n, 3) mm, exact in float32."""
    return np.random.default_rng(seed).uniform(-300, 300, (points, 3)).astype(np.float32).astype(float)


def in_base(points: Array, pose: str = POSE) -> Array:
    """Points (n, 3) of a camera whose flange was at `pose`, in the base frame."""
    numbers = [float(part) for part in pose.split(",")]
    return map_points(transform_from_quaternion(numbers[:3], numbers[3:]) @ FLANGE_T_CAMERA, points)


def laz_of(points: Array, *, compress: bool = True) -> bytes:
    """LAZ (LAS: not compressed) with intensities 0, 1, 2, ...; the test is skipped without laspy."""
    laspy = pytest.importorskip("laspy", reason="laspy is not installed: LAZ is not tested")
    content = laspy.create(point_format=3)
    content.header.scales = [0.001] * 3
    content.x, content.y, content.z = points.T
    content.intensity = np.arange(len(points)) % 60_000
    file = io.BytesIO()
    content.write(file, do_compress=compress)
    return file.getvalue()
