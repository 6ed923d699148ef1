"""An arm whose errors follow its posture is no board that moved or of another size; those are named beside them."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.diagnosis.diagnose import diagnose
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.measured import measured_evidence
from calibration.diagnosis.view_hypotheses import CHANGE_CODES
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import Postures
from calibration.observations.measured_poses import measured_views
from calibration.transforms import inverse, rotation_from_vector, transform, transform_from_vector
from mock_robot.arm.built_arm import build_arm
from tests.simulated.measured_sessions import measured_cell, tracker

VIEWS, CENTRE_MM = 16, np.array([75.0, 52.5, 0.0])
SEEN = np.repeat([2e-5, 0.01], 3)
"""One standard deviation of the target's pose by the images, rad and mm."""


def two_postures(seed: int) -> Evidence:
    """Views with an arm as built whose wrist stands turned over from the middle one on."""
    rng, arm = np.random.default_rng(seed), find_arm("IRB 2600-20/1.65")
    joints = np.array([0.1, 0.2, 0.1, 0.0, 0.9, 0.0]) + rng.uniform(-0.35, 0.35, (VIEWS, 6)) * [1, 1, 1, 1, 1, 3]
    joints[VIEWS // 2 :] = joints[VIEWS // 2 :] * [1, 1, 1, 1, -1, 1] + [0, 0, 0, np.pi, 0, -np.pi]
    X = transform(rotation_from_vector([0.03, -0.02, 1.2]), np.array([60.0, 10.0, 90.0]))
    Y = transform(rotation_from_vector([np.pi, 0.0, 0.0]), np.array([1000.0, 0.0, 0.0]))
    stands = build_arm(arm, "standard", seed).base_T_flange(Postures(joints))
    seen = transform_from_vector(SEEN * rng.standard_normal((VIEWS, 6))) @ inverse(stands @ X) @ Y
    covariance = np.tile(np.diag(SEEN**2), (VIEWS, 1, 1))
    one = np.arange(VIEWS)
    return Evidence("eye-in-hand", one, arm.forward(joints), seen, covariance, np.full(VIEWS, 170.0), joints)


def named(evidence: Evidence) -> str | None:
    found = diagnose(evidence, CENTRE_MM, len(evidence))
    return None if found is None else found.cause.code


@pytest.mark.parametrize("seed", [2, 3])
def test_errors_of_another_posture_are_no_move(seed: int) -> None:
    evidence = two_postures(seed)
    assert named(evidence) not in CHANGE_CODES
    assert named(replace(evidence, joints_rad=None)) in CHANGE_CODES, "nothing else shows the posture"


@pytest.mark.parametrize(("change", "code"), [("camera", "camera-or-tool-changed"), ("board", "board-moved")])
def test_a_move_among_the_views_of_a_posture_is_named_beside_them(change: str, code: str) -> None:
    evidence = two_postures(1)
    seen, moved = (
        evidence.camera_T_target.copy(),
        transform(rotation_from_vector([0.0, 0.004, 0.002]), np.array([2.0, 1.0, -1.0])),
    )
    seen[5:] = moved @ seen[5:] if change == "camera" else seen[5:] @ moved
    assert named(evidence.with_camera_poses(seen)) == code


@pytest.mark.parametrize("seed", [1, 10, 14])
def test_links_of_other_lengths_are_no_other_pitch(seed: int) -> None:
    assert named(two_postures(seed)) is None


@pytest.mark.parametrize("factor", [0.97, 0.99, 1.01, 1.03])
def test_another_pitch_is_named_beside_errors_of_the_arm(factor: float) -> None:
    assert named(two_postures(14).scale_target(factor)) == "wrong-pitch"


def test_joints_of_views_that_measure_in_space_are_evidence() -> None:
    problem = measured_cell(np.random.default_rng(3), 8, tracker()).problem
    joints = np.arange(48.0).reshape(8, 6)
    views = tuple(replace(view, joints_rad=one) for view, one in zip(problem.views, joints, strict=True))
    for chosen, expected in ((views, joints), ((replace(views[0], joints_rad=None), *views[1:]), None)):
        recorded = replace(problem, views=chosen)
        seen, _ = measured_views(recorded)
        found = measured_evidence(recorded, seen, np.tile(np.eye(6), (8, 1, 1))).joints_rad
        np.testing.assert_array_equal(found, expected)
