"""The truth is seeded, plausible, printable, and the sheet does not give it away."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from calibration.detection.detect import detect
from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetFile
from calibration.documents.validation import validate_document
from calibration.kinematics.abb_arms import find_arm
from calibration.problem import Setup
from calibration.targets import AprilTagGrid, Chessboard, CircleGrid
from calibration.transforms import Array, difference, inverse, map_points, rotation_from_vector, transform
from mock_robot.scene.camera_view import render
from mock_robot.scene.printed_target import print_target
from mock_robot.truth.start_posture import start_joints
from mock_robot.truth.truth import TARGET_MIDDLE_MM, CellTruth
from mock_robot.truth.truth_sheet import BOX_MM, cell_sheet, scan_poses_of, truth_document

SEEDS = range(40)


def middle(truth: CellTruth) -> Array:
    return np.append(print_target(truth.target, truth.sheet).outline_mm.mean(axis=0), 0.0)


def test_the_same_seed_is_the_same_cell_and_another_seed_another() -> None:
    first, again, other = (json.dumps(truth_document(CellTruth.from_seed(seed))) for seed in (5, 5, 6))
    assert first == again
    assert first != other


def test_the_camera_looks_along_the_flange_from_a_few_centimetres_off() -> None:
    for seed in SEEDS:
        flange_T_camera = CellTruth.from_seed(seed).flange_T_camera
        assert np.degrees(np.arccos(flange_T_camera[2, 2])) < 23.0
        assert 30.0 < np.linalg.norm(flange_T_camera[:3, 3]) < 160.0


def test_the_target_lies_on_the_table_and_faces_up() -> None:
    for seed in SEEDS:
        truth = CellTruth.from_seed(seed)
        assert truth.base_T_target[2, 2] < -np.cos(np.radians(12.0))
        on_table = map_points(truth.base_T_target, middle(truth)[None])[0]
        assert on_table == pytest.approx(TARGET_MIDDLE_MM, abs=25.0)


def test_guesses_are_off_by_millimetres_and_degrees_but_not_more() -> None:
    for seed in SEEDS:
        truth = CellTruth.from_seed(seed)
        for true, guess in (
            (truth.flange_T_camera, truth.nominal.mount_T_camera),
            (truth.base_T_target, truth.nominal.anchor_T_target),
            (truth.base_T_part, truth.nominal.base_T_part),
        ):
            off_mm, off_rad = difference(true, guess)
            assert 0.1 < off_mm < 20.0
            assert 1e-4 < off_rad < np.radians(4.0)


def test_the_sheet_says_what_an_integrator_knows_and_nothing_of_the_truth() -> None:
    truth = CellTruth.from_seed(7)
    sheet = json.loads(json.dumps(cell_sheet(truth)))
    assert validate_document(TargetFile, {"target": sheet["target"]}, "the sheet").target == truth.target
    assert CameraDocument.model_validate(sheet["camera"]).camera().matrix == pytest.approx(truth.camera.matrix)

    elsewhere = transform(rotation_from_vector([0.1, 0.2, 0.3]), [50.0, 60.0, 70.0])
    hidden = {name: getattr(truth, name) @ elsewhere for name in HIDDEN}
    assert cell_sheet(replace(truth, **hidden)) == cell_sheet(truth), "hidden poses must not leave a trace"


HIDDEN = ("mount_T_camera", "mount_T_scanner", "anchor_T_target", "base_T_part")


@pytest.mark.parametrize(
    ("setup", "names"),
    [
        ("eye-in-hand", ("flange_T_camera", "flange_T_scanner", "base_T_target", "base_T_part")),
        ("eye-to-hand", ("base_T_camera", "base_T_scanner", "flange_T_target", "base_T_part")),
    ],
)
def test_the_truth_is_printed_as_poses_that_read_back(setup: Setup, names: tuple[str, ...]) -> None:
    truth = CellTruth.from_seed(7, setup=setup)
    document = json.loads(json.dumps(truth_document(truth)))
    for name, hidden in zip(names, HIDDEN, strict=True):
        printed = PoseDocument.model_validate(document[name]).transform()
        assert printed == pytest.approx(getattr(truth, hidden), abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_camera_on_a_stand_sees_the_target_that_the_arm_holds_up(seed: int) -> None:
    truth = CellTruth.from_seed(seed, setup="eye-to-hand")
    arm = find_arm(truth.arm)
    seen = map_points(truth.camera_T_target(arm.forward(start_joints(arm, truth))), truth.target.points_mm)
    pixels = truth.camera.project(seen)
    assert np.all((pixels > 0) & (pixels < truth.camera.image_size))


@pytest.mark.parametrize(
    "target", [Chessboard(9, 6, 20.0), CircleGrid("asymmetric", 4, 11, 30.0), AprilTagGrid(4, 4, 30.0, 9.0)]
)
def test_a_cell_can_have_any_target(target: Chessboard | CircleGrid | AprilTagGrid) -> None:
    truth = CellTruth.from_seed(3, target=target)
    document = cell_sheet(truth)["target"]
    assert json.loads(json.dumps(document)) == asdict(target)
    assert map_points(truth.base_T_target, middle(truth)[None])[0] == pytest.approx(TARGET_MIDDLE_MM, abs=25.0)


def test_the_arm_reaches_every_taught_scan_pose_inside_the_box() -> None:
    low, high = np.array(BOX_MM)
    for seed in SEEDS:
        truth = CellTruth.from_seed(seed)
        joints = np.zeros(6)
        for pose in scan_poses_of(truth):
            joints = find_arm(truth.arm).nearest(pose, joints)  # raises when it cannot
            assert np.all((pose[:3, 3] > low) & (pose[:3, 3] < high))


def test_default_optics_leave_about_a_twentieth_of_a_pixel_of_noise() -> None:
    truth = CellTruth.from_seed(1)
    errors = []
    for turn in (0.2, 1.4):
        look = transform(rotation_from_vector([0.3, -0.25, turn]), [10.0, -5.0, 620.0])
        camera_T_target = look @ transform(np.eye(3), -middle(truth))
        picture = render(truth.camera, truth.target, camera_T_target, truth.optics, np.random.default_rng(2))
        found = detect(picture, truth.target)
        true_px = truth.camera.project(map_points(camera_T_target, truth.target.points_mm))[found.ids]
        errors.append(found.corners_px - true_px)
    assert 0.03 < np.concatenate(errors).std() < 0.06


def test_a_flange_pose_that_looks_at_the_target_sees_it_in_the_middle() -> None:
    truth = CellTruth.from_seed(2)
    look = transform(np.eye(3), [0.0, 0.0, 600.0]) @ transform(np.eye(3), -middle(truth))
    base_T_flange = truth.base_T_target @ inverse(look) @ inverse(truth.flange_T_camera)
    find_arm(truth.arm).nearest(base_T_flange, np.zeros(6))
    camera_T_target = inverse(base_T_flange @ truth.flange_T_camera) @ truth.base_T_target
    pixels = truth.camera.project(map_points(camera_T_target, truth.target.points_mm))
    assert np.all((pixels > 0) & (pixels < truth.camera.image_size))
