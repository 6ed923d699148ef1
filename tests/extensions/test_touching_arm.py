"""Touch tests of arms as built: what is not known of the arm where it looked and where it touched."""

import numpy as np
import pytest

from calibration.documents.calibration import calibration_document
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.documents.tip import TipDocument
from calibration.documents.touch_test import TouchTestDocument
from calibration.documents.touches import TouchDocument, TouchesDocument
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_errors import AXES, ArmErrorModel, Postures
from calibration.kinematics.arm_estimate import ArmEstimate
from calibration.solve import solve_hand_eye
from calibration.transforms import Array, inverse, map_points
from calibration.verdict import judge
from extensions.arm_identification.mathematics.documents import identify_arm_document
from extensions.touch.mathematics.report import TouchingArm, touch_test
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import (
    ArmCell,
    arm_cell,
    box_postures,
    draw_scatter,
    reachable_views,
    target_places,
)
from tests.support.cases import seeds

ARM = find_arm("IRB 2600-20/1.65")
ARMS, TOUCHES = 20, 6
PLACING_MM, TIP_MM = 0.03, (0.0, 0.0, 150.0)
TIP = TipDocument.model_validate(
    {
        "flange_tip_mm": TIP_MM, "covariance": (1e-6 * np.eye(3)).tolist(), "placing_sigma_mm": PLACING_MM,
    }
)  # fmt: skip


def draw_stands(rng: np.random.Generator, cell: ArmCell, joints_rad: Array) -> Array:
    """Where the flange truly is (n, 4, 4), with play of either side and scatter."""
    n = len(joints_rad)
    scatter = draw_scatter(rng, n)
    return cell.built.base_T_flange(Postures(joints_rad, sides=rng.choice([-1.0, 1.0], (n, AXES)))) @ scatter


def draw_touch_tests(seed: int) -> tuple[TouchTestDocument, TouchTestDocument]:
    """Of an arm from twelve views of one place, which touches where its box is: with what is not known of it, without.

    A point is where the tip truly is, but for placing it; the camera sees it from a posture of the session's place.
    """
    rng, made = np.random.default_rng([seed, 7]), {"created_at": "2026-11-23T12:00:00Z", "software": "handeyed 0"}
    (target,) = target_places(rng, ARM, 1)
    cell = arm_cell(rng, build_arm(ARM, "standard", seed), [reachable_views(rng, ARM, target, 12)], [target])
    solution = solve_hand_eye(cell.problems[0])
    document = calibration_document(solution, judge(cell.problems[0], solution), calibration_id="cal-1", **made)
    given = CalibrationInUse.of(document, identify_arm_document(ARM, cell.problems, **made))
    assert given.arm is not None, f"arm {seed} shows no errors"
    touched, looks = box_postures(rng, ARM, TOUCHES), reachable_views(rng, ARM, target, TOUCHES)
    points = map_points(draw_stands(rng, cell, touched), np.array([TIP_MM])[:, None])[:, 0]
    points = points + PLACING_MM * rng.standard_normal((TOUCHES, 3))
    camera_mm = map_points(inverse(draw_stands(rng, cell, looks) @ cell.mount_T_camera), points[:, None])[:, 0]
    seen_from, at = given.arm.base_T_flange(looks), given.arm.base_T_flange(touched)
    touches = TouchesDocument(
        placing_sigma_mm=PLACING_MM,
        touches=tuple(
            TouchDocument(
                camera_mm=tuple(camera_mm[row]), seen_from=PoseDocument.of(seen_from[row]),
                base_T_flange=PoseDocument.of(at[row]),
            )
            for row in range(TOUCHES)
        )
    )  # fmt: skip
    arm = TouchingArm(given.arm, touched, list(looks[:, None]))
    return touch_test(given.document, TIP, touches, {}, arm=arm), touch_test(given.document, TIP, touches, {})


def mean_square(found: TouchTestDocument) -> float:
    """Mean square of the misses over what is claimed of each."""
    return float(np.mean([(2 * point.length_mm / point.claimed_mm) ** 2 for point in found.points]))


@pytest.mark.slow
def test_misses_are_as_large_as_claimed_with_what_is_not_known_of_the_arm() -> None:
    squares = [[mean_square(found) for found in draw_touch_tests(seed)] for seed in seeds(ARMS)]
    with_arm, without = np.sqrt(np.mean(squares, axis=0))
    print(
        f"misses over what is claimed, RMS of {len(squares)} arms: {with_arm:.2f},"
        f" without the arm's uncertainty {without:.2f}"
    )
    assert 0.9 < with_arm < 1.15 < without, (with_arm, without)


def test_an_error_that_moves_camera_and_tip_alike_is_no_part_of_the_miss() -> None:
    """The zero of axis 2 turns all that is carried behind axis 1; that of axis 5 depends on the posture."""
    model, point = ArmErrorModel(ARM), np.array([1000.0, 100.0, 500.0])
    joints = np.radians([[10.0, 20, 10, 0, 40, 0], [10.0, 35, -5, 20, 50, 60]])
    estimate = ArmEstimate(model, np.zeros(len(model)), np.zeros((6 + len(model),) * 2), np.eye(4))
    poses = ARM.forward(joints)
    on_flange = map_points(inverse(poses), np.array([[point]] * 2))[:, 0]
    looked, touched = TouchingArm(estimate, joints, []).rows(poses, on_flange, joints)
    zero_2, zero_5 = model.index("zero_2"), model.index("zero_5")
    np.testing.assert_allclose(looked[:, zero_2], touched[:, zero_2], atol=1e-9)
    assert np.linalg.norm(looked[:, zero_5] - touched[:, zero_5]) > 100.0  # mm/rad
