"""The paper's own numbers: its quaternions and translations, its X, its Tab. 1."""

import numpy as np
import pytest

from calibration.closed_forms.three_pose import solve_three_pose
from calibration.solve import solve_hand_eye
from calibration.targets import Chessboard
from calibration.transforms import (
    Array,
    inverse,
    map_points,
    nearest_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    transform,
    transform_from_quaternion,
)
from calibration.verdict import judge
from tests.simulated.sessions import CAMERA, Cell, CellNoise, observed
from tests.simulated.spoiled_sessions import error_of

QUATERNIONS_WXYZ = [
    [0.169248, 0.338681, 0.630323, -0.677749],
    [0.316172, 0.15988, 0.408206, -0.841333],
    [0.00599902, -0.481792, -0.759899, 0.436341],
]
TRANSLATIONS_MM = [[128.36, -394.44, 1051.65], [155.78, -204.38, 979.51], [77.6, -584.51, 1036.17]]
BASE_T_FLANGE = transform_from_quaternion(TRANSLATIONS_MM, QUATERNIONS_WXYZ)

PRINTED_R = [
    [[-0.7133, 0.6564, -0.2457], [0.1975, -0.1481, -0.9690], [-0.6724, -0.7398, -0.0240]],
    [[-0.7489, 0.6625, -0.0109], [-0.4015, -0.4668, -0.7880], [-0.5272, -0.5858, -0.6156]],
    [[-0.5357, 0.7270, -0.4296], [0.7375, 0.1550, -0.6574], [-0.4113, -0.6689, -0.6191]],
]
PRINTED_X = np.array(
    [
        [0.4610, 0.2494, -0.9623, -101.2112],
        [-0.9766, -0.0254, -0.4631, 285.4014],
        [-0.0684, 0.9882, 0.2537, 538.4676],
        [0, 0, 0, 1],
    ]
)
TABLE_1_BASE_MM = [
    [
        [-63.9036, -515.9665, 852.2903],
        [7.8773, -396.5096, 835.4014],
        [79.2120, -277.0448, 818.8308],
        [-111.0777, -340.9350, 777.7743],
    ],
    [
        [-63.8404, -515.9983, 849.3209],
        [124.6599, -451.8614, 892.2303],
        [6.2858, -396.3833, 833.5678],
        [-113.2753, -339.8775, 776.2754],
    ],
    [[-61.5831, -517.2230, 838.6951], [86.1008, -273.7438, 801.7488]],
]


def seeds_cell(noise: CellNoise, seed: int = 0) -> Cell:
    """The paper's three poses, looking at a board that lies where the cross target lay."""
    X = inverse(transform(nearest_rotation(PRINTED_X[:3, :3])[0], PRINTED_X[:3, 3]))
    board = Chessboard(11, 8, 15.0)
    looking = inverse(BASE_T_FLANGE[0] @ X)[:3, :3]
    turn = looking.T @ rotation_from_vector([0.25, 0.2, 0.0])
    Y = transform(turn, np.array([0.0, -400.0, 835.0]) - turn @ board.points_mm.mean(axis=0))
    rng = np.random.default_rng(seed)
    return observed(rng, "eye-in-hand", board, BASE_T_FLANGE, X, Y, noise, camera=CAMERA)


@pytest.mark.parametrize("position", [0, 2])
def test_r1_and_r3_are_what_their_quaternions_say(position: int) -> None:
    ours = rotation_from_quaternion(QUATERNIONS_WXYZ[position])
    assert np.allclose(ours, PRINTED_R[position], atol=2e-4)


def test_r2_is_printed_with_one_wrong_sign() -> None:
    difference = np.abs(rotation_from_quaternion(QUATERNIONS_WXYZ[1]) - PRINTED_R[1]) > 2e-4
    assert np.argwhere(difference).tolist() == [[2, 2]]
    assert rotation_from_quaternion(QUATERNIONS_WXYZ[1])[2, 2] == pytest.approx(0.6156, abs=1e-4)


def test_the_printed_x_is_no_rigid_transform() -> None:
    assert np.allclose(np.linalg.svd(PRINTED_X[:3, :3])[1], [1.0991, 1.0966, 1.0023], atol=2e-4)
    assert np.linalg.det(PRINTED_X[:3, :3]) == pytest.approx(1.208, abs=1e-3)


def test_the_printed_x_maps_the_flange_to_the_camera_and_not_back() -> None:
    def depths(flange_to_camera: Array) -> Array:
        in_camera = [
            map_points(flange_to_camera @ inverse(pose), points)
            for pose, points in zip(BASE_T_FLANGE, TABLE_1_BASE_MM, strict=True)
        ]
        return np.concatenate(in_camera)[:, 2]

    assert np.all((depths(PRINTED_X) > 513) & (depths(PRINTED_X) < 710))
    assert np.all(depths(np.linalg.inv(PRINTED_X)) < 0)


@pytest.mark.parametrize("method", ["three-pose", "auto"])
def test_without_noise_the_printed_poses_give_the_known_x_back(method: str) -> None:
    cell = seeds_cell(CellNoise(0.0, 0.0, 0.0))
    translation_mm, rotation_deg = error_of(solve_hand_eye(cell.problem, method).mount_T_camera, cell)
    assert translation_mm < 1e-3
    assert rotation_deg < 1e-4


def test_with_noise_the_printed_poses_give_an_x_within_its_large_uncertainty_and_it_is_refused() -> None:
    cell = seeds_cell(CellNoise())
    solution = solve_hand_eye(cell.problem)
    verdict = judge(cell.problem, solution)
    by_code = {finding.code: finding for finding in verdict.findings}
    assert solution.uncertainty is not None and solution.mount_T_camera is not None
    assert 5 < solution.uncertainty.point_mm < 60
    off = np.abs(solution.mount_T_camera[:3, 3] - cell.mount_T_camera[:3, 3])
    assert np.all(off < 4 * solution.uncertainty.translation_mm)
    assert not verdict.accepted
    assert by_code["point-uncertain"].severity == "error"
    assert "within 2.8 degrees" in by_code["axes-nearly-parallel"].message


def test_the_seeds_method_reports_its_projection_and_its_direction() -> None:
    cell = seeds_cell(CellNoise())
    (finding,) = [f for f in solve_hand_eye(cell.problem, "three-pose").findings if f.code == "three-pose"]
    assert "2.8 degrees apart" in finding.message
    assert "camera_T_flange" in finding.message


def test_the_seeds_axes_are_2_8_degrees_from_antiparallel() -> None:
    cell = seeds_cell(CellNoise(0.0, 0.0, 0.0))
    camera_T_target = inverse(BASE_T_FLANGE @ cell.mount_T_camera) @ cell.anchor_T_target
    assert np.degrees(solve_three_pose(BASE_T_FLANGE, camera_T_target).axis_angle_rad) == pytest.approx(2.8, abs=0.05)
