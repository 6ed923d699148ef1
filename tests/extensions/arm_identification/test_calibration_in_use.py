"""What a calibration says of itself while the errors of its arm are active: X, its uncertainty, the robot's noise."""

from functools import cache

import numpy as np
import pytest

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument, UncertaintyDocument, calibration_document
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm_conditions import ArmConditions
from calibration.kinematics.load import Load
from calibration.kinematics.stance import Stance
from calibration.solve import solve_hand_eye
from calibration.transforms import inverse, vector_from_transform
from calibration.verdict import judge
from extensions.arm_identification.mathematics.documents import identify_arm_document
from mock_robot.arm.built_arm import build_arm
from tests.simulated.arms import ArmCell, arm_cell, reachable_views, target_before

ARM = find_arm("IRB 2600-20/1.65")


@cache
def session() -> tuple[ArmCell, CalibrationDocument, ArmErrorsDocument]:
    """Twelve views of a standard arm with 10 kg on its flange, its calibration.json and its arm.json."""
    rng, target = np.random.default_rng(0), target_before(ARM)
    joints = [reachable_views(rng, ARM, target, 12)]
    cell = arm_cell(rng, build_arm(ARM, "standard", 0), joints, [target], load=Load(10.0, (0.0, 0.0, 80.0)))
    solution, made = solve_hand_eye(cell.problems[0]), {"created_at": "2026-11-23T12:00:00Z", "software": "handeyed 0"}
    document = calibration_document(solution, judge(cell.problems[0], solution), calibration_id="cal-1", **made)
    return cell, document, identify_arm_document(ARM, cell.problems, **made)


JOINTS = np.radians([10.0, 45.0, -10.0, 20.0, 40.0, 0.0])


def uncertainty_of(document: CalibrationDocument) -> UncertaintyDocument:
    assert document.uncertainty is not None
    return document.uncertainty


def test_x_of_the_arm_as_built_has_its_own_covariance_points_and_noise() -> None:
    _, drawn, errors = session()
    given = CalibrationInUse.of(drawn, errors)
    before, after = uncertainty_of(drawn), uncertainty_of(given.document)
    np.testing.assert_allclose(after.matrix(), np.array(errors.covariance)[:6, :6])
    assert given.document.noise.robot_translation_mm == errors.scatter_mm
    assert given.document.noise.image_px == drawn.noise.image_px
    assert [point.name for point in after.points] == [point.name for point in before.points]
    nearest, farthest = (after.points[row] for row in (0, -1))
    assert nearest.sigma_mm != before.points[0].sigma_mm
    assert farthest.expanded_mm == pytest.approx(2 * farthest.sigma_mm)
    assert nearest.sigma_mm / 2 < after.point_mm < max(point.sigma_mm for point in after.points)


def test_the_error_of_x_fits_the_covariance_that_is_given_with_it() -> None:
    cell, drawn, errors = session()
    document = CalibrationInUse.of(drawn, errors).document
    assert document.mount_T_camera is not None
    off = vector_from_transform(inverse(document.mount_T_camera.transform()) @ cell.mount_T_camera)
    assert float(off @ np.linalg.solve(uncertainty_of(document).matrix(), off)) < 22.5  # chi², 6 dof, 99.9 %


def test_under_another_load_the_arm_sags_for_that_and_the_answer_warns() -> None:
    _, drawn, errors = session()
    unknown = errors.model_copy(update={"load": None})
    stance = Stance(ARM.forward(JOINTS), JOINTS)

    def place(errors: ArmErrorsDocument, carried: float | None) -> tuple[list[str], float, float]:
        """Codes of the warnings, height of the flange and standard deviation of a point, mm."""
        load = None if carried is None else Load(carried, (0.0, 0.0, 80.0))
        given = CalibrationInUse.of(drawn, errors, ArmConditions(load))
        placement = given.placement([stance])
        assert placement is not None
        height_mm = float(given.base_T_flange([stance])[0, 2, 3])
        return [finding.code for finding in given.findings([stance])], height_mm, placement.point_mm

    quiet, height_mm, sigma_mm = place(errors, 10.5)
    assert (quiet, height_mm) == place(errors, None)[:2] == ([], place(errors, 10.0)[1])
    warned, lower_mm, wider_mm = place(errors, 20.0)
    assert warned == ["arm-other-load"]
    assert abs(lower_mm - height_mm) > 1e-6
    assert wider_mm > sigma_mm
    assert place(unknown, 20.0)[0] == []


def test_an_arm_whose_temperature_was_known_and_is_not_now_is_warned_of() -> None:
    _, drawn, errors = session()

    def warnings(identified_c: float | None, now_c: float | None) -> list[str]:
        stated = errors.model_copy(update={"temperature_c": identified_c})
        given = CalibrationInUse.of(drawn, stated, ArmConditions(Load(10.0, (0.0, 0.0, 80.0)), now_c))
        return [finding.message for finding in given.findings([Stance(ARM.forward(JOINTS), JOINTS)])]

    assert warnings(None, None) == warnings(None, 30.0) == warnings(24.0, 30.0) == []
    (warned,) = warnings(24.0, None)
    assert "24.0 °C" in warned
    assert "5 K" in warned


def test_an_arm_whose_errors_are_not_taken_up_changes_nothing() -> None:
    _, drawn, errors = session()
    assert CalibrationInUse.of(drawn, errors.model_copy(update={"taken_up": False})).document is drawn
