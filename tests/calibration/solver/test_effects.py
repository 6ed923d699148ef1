"""What differs from view to view: the first-order effect on the points, and what sessions say of it."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.camera import CameraModel
from calibration.preprocessing.prepare import prepare
from calibration.problem import Detection, Setup
from calibration.solve import estimate_hand_eye, estimate_session, solve_hand_eye
from calibration.solver.effects import KINDS, glass, refocusing
from calibration.transforms import Array, map_points, rotation_from_vector, transform
from tests.simulated.described_wrongly import CAMERA, FAULTS, HIGH, LOW, Wrong, through_glass, wrong_session
from tests.simulated.faults import SETUPS
from tests.support.cases import seeds

DISTORTED = replace(CAMERA, distortion=np.array([-0.15, 0.05, 1e-3, -1e-3]))
FISHEYE = replace(CAMERA, distortion=np.array([-0.02, 0.01, 0.0, 0.0]), lens_model="fisheye")
GRID_MM = np.stack(np.meshgrid(np.linspace(-100, 100, 5), np.linspace(-80, 80, 4), [0.0]), axis=-1).reshape(-1, 3)


def poses() -> Array:
    """The target from 400, 600 and 800 mm, tilted by 35 degrees about three axes."""
    tilts = (np.radians(35) * np.array([np.cos(about), np.sin(about), 0.0]) for about in (0.3, 2.4, 4.5))
    facing = rotation_from_vector([np.pi, 0.0, 0.0])
    places = ([20.0, -30.0, 400.0], [-40.0, 10.0, 600.0], [0.0, 50.0, 800.0])
    return np.array(
        [transform(facing @ rotation_from_vector(tilt), place) for tilt, place in zip(tilts, places, strict=True)]
    )


@pytest.mark.parametrize("camera", [CAMERA, DISTORTED, FISHEYE], ids=["pinhole", "distorted", "fisheye"])
def test_a_lens_that_refocuses_moves_the_points_as_other_focal_lengths_do(camera: CameraModel) -> None:
    points = np.broadcast_to(GRID_MM, (3, *GRID_MM.shape))
    moved = refocusing(camera, poses(), points)
    nearness = np.array([1 / map_points(pose, GRID_MM)[:, 2].mean() for pose in poses()])
    for pose, by, share in zip(poses(), moved, 2.0 * (nearness - nearness.mean()), strict=True):
        matrix = camera.matrix.copy()
        matrix[[0, 1], [0, 1]] *= 1 + share
        expected = replace(camera, matrix=matrix).project(map_points(pose, GRID_MM))
        seen = camera.project(map_points(pose, GRID_MM + 2.0 * by))
        assert np.abs(seen - expected).max() < 0.02 * np.abs(expected - camera.project(map_points(pose, GRID_MM))).max()


def test_points_below_glass_rise_as_snell_s_law_has_it() -> None:
    rises = glass(CAMERA, poses(), np.broadcast_to(GRID_MM, (3, *GRID_MM.shape)))
    for pose, rise in zip(poses(), rises, strict=True):
        seen = CAMERA.project(map_points(pose, GRID_MM + 3.0 * rise))
        expected = CAMERA.project(through_glass(Wrong(glass_mm=3.0), pose, GRID_MM))
        assert np.abs(seen - expected).max() < 0.05


@pytest.mark.parametrize("fault", ["autofocus", "glass 5 mm"])
@pytest.mark.parametrize("spoil", ["renumbered", "blurred"])
def test_one_odd_picture_beside_an_effect_is_left_out_or_renumbered(fault: str, spoil: str) -> None:
    rng = np.random.default_rng(1)
    session = wrong_session(rng, 10, FAULTS[fault], LOW, "eye-in-hand", "planned")
    odd = session.problem.views[3]
    assert odd.detection is not None
    ids, corners = odd.detection.ids, odd.detection.corners_px
    other = (
        Detection(ids[::-1], corners)
        if spoil == "renumbered"
        else Detection(ids, corners + 60 * rng.normal(size=corners.shape))
    )
    views = tuple(replace(view, detection=other) if view is odd else view for view in session.problem.views)
    solution = solve_hand_eye(replace(session.problem, views=views))
    assert solution.mount_T_camera is not None
    assert np.linalg.norm((solution.mount_T_camera - session.mount_T_camera)[:3, 3]) < 1.0


def test_robot_and_pictures_show_tangential_distortion_that_three_pictures_alone_do_not() -> None:
    rng = np.random.default_rng(6)
    problem = wrong_session(rng, 3, FAULTS["tangential, rectified"], HIGH, "eye-in-hand", "random").problem
    assert not prepare(problem).nuisances.shows_tangential
    assert estimate_session(problem).prepared.nuisances.shows_tangential


@pytest.mark.parametrize("setup", SETUPS)
def test_sessions_as_described_show_no_effect(setup: Setup) -> None:
    codes = {kind.code for kind in KINDS}
    for seed in seeds(6):
        views, noise = ((3, LOW), (4, HIGH), (5, LOW), (6, HIGH), (8, LOW), (12, HIGH))[seed % 6]
        session = wrong_session(np.random.default_rng(seed), views, FAULTS["none"], noise, setup, "random")
        assert not codes & {finding.code for finding in estimate_hand_eye(session.problem).findings}, seed
