"""The mock's profiles lie on what they were taken of."""

import numpy as np

from calibration.transforms import inverse, map_points, rotation_from_vector, transform
from mock_robot.scene.part import DOOR
from mock_robot.scene.scanner_view import ProfilerModel, profile_door
from tests.support.profiled_sphere import profile_sphere

PROFILER = ProfilerModel(columns=40, noise_mm=0.0)
FACING = rotation_from_vector([np.pi, 0, 0])
POSES = np.array([transform(FACING @ rotation_from_vector([0.0, 0.1, 0.2]), [x, -30.0, 450.0]) for x in (-80.0, 0.0)])


def test_a_profile_of_the_door_lies_on_its_skin() -> None:
    x, z = profile_door(PROFILER, POSES, np.random.default_rng(0))
    assert np.isfinite(z).all()
    for pose, points in zip(POSES, np.stack([x, 0 * x, z], axis=-1), strict=True):
        np.testing.assert_allclose(DOOR.deviation(map_points(pose, points)), 0.0, atol=1e-4)


def test_a_profile_of_a_sphere_lies_on_its_near_side() -> None:
    centre = np.array([10.0, -20.0, 5.0])
    x, z = profile_sphere(PROFILER, inverse(POSES), centre, 40.0, np.random.default_rng(0))
    seen = np.isfinite(z[1])
    assert 10 < seen.sum() < 40
    points = map_points(POSES[1], np.stack([x, 0 * x, z], axis=-1)[1][seen])
    np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 40.0, atol=1e-9)
    assert (points[:, 2] > centre[2]).all()


def test_points_out_of_range_are_missing() -> None:
    _, z = profile_door(ProfilerModel(columns=20, range_mm=(500.0, 700.0)), POSES, np.random.default_rng(0))
    assert np.isnan(z).all()
