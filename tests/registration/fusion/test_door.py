"""The mock cell's door: what the report says of the views is what the truth says."""

import numpy as np
import pytest

from calibration.kinematics.robot_accuracy import RobotNoise
from calibration.transforms import difference, inverse, map_points, rotation_from_vector, transform
from mock_robot.scene.part import DOOR
from mock_robot.scene.scanner_view import ScannerModel, scan
from mock_robot.truth.truth import CellTruth
from mock_robot.truth.truth_sheet import scan_poses_of
from registration.fusion.overlap import agreement
from registration.fusion.pose_adjustment import refine_poses
from registration.points.layout import XYZ_FLOAT32
from registration.points.surface import Surface, sample_points

pytestmark = pytest.mark.slow

NOISE = RobotNoise(0.3, float(np.deg2rad(0.03)))


def test_views_of_the_door_agree_as_well_as_the_scanner_measures_and_refinement_beats_the_robot() -> None:
    truth, random = CellTruth.from_seed(1), np.random.default_rng(1)
    said = scan_poses_of(truth)[:4]
    errors = [
        transform(rotation_from_vector(random.normal(0, NOISE.rotation_rad, 3)), random.normal(0, 0.3, 3)) for _ in said
    ]
    true = [pose @ error for pose, error in zip(said, errors, strict=True)]
    part_T_base, x = inverse(truth.base_T_part), truth.flange_T_camera
    scanner = ScannerModel(columns=320, rows=240, focal=480.0)
    clouds = [scan(scanner, [part_T_base @ pose @ truth.flange_T_scanner], random) for pose in true]
    records = [np.ascontiguousarray(points).view(XYZ_FLOAT32.dtype)[:, 0] for points in clouds]
    surfaces = [Surface.of(sample_points([block], XYZ_FLOAT32, 1.0)) for block in records]
    off = [
        DOOR.deviation(map_points(part_T_base @ pose @ x, surface.points[::50]))
        for pose, surface in zip(true, surfaces, strict=True)
    ]
    scanner_mm = np.sqrt(np.mean(np.concatenate(off) ** 2))
    at_truth = agreement(surfaces, [pose @ x for pose in true]).rms_mm
    assert at_truth is not None
    assert scanner_mm < at_truth < 2 * scanner_mm

    plain = [pose @ x for pose in said]
    found = refine_poses(surfaces, plain, said, NOISE)
    refined = [correction.motion @ pose for correction, pose in zip(found.corrections, plain, strict=True)]
    after = agreement(surfaces, refined).rms_mm
    assert after is not None
    assert after < 1.1 * at_truth
    before_rad, after_rad = (
        np.mean([difference(pose @ inverse(x), truth)[1] for pose, truth in zip(poses, true, strict=True)])
        for poses in (plain, refined)
    )
    assert after_rad < 0.8 * before_rad
