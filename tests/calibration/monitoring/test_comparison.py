"""Two calibrations of one camera compared: what both claim decides whether they agree."""

from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.documents.pose import PoseDocument
from calibration.errors import ComparisonError
from calibration.monitoring.comparison import compare, comparison_text
from calibration.sentences.sentence import text_of
from calibration.transforms import Array, transform_from_vector
from calibration.verdict import judge
from tests.simulated.spoiled_sessions import solved_session

PROBLEM, SOLVED = solved_session()
A = calibration_document(SOLVED, judge(PROBLEM, SOLVED), calibration_id="a", created_at="now", software="handeyed 0")
VERSION_1 = CalibrationDocument.model_validate_json(
    (Path(__file__).parents[1] / "documents" / "calibration_version_1.json").read_bytes()
)


def moved(step: Array) -> CalibrationDocument:
    """`A` with its camera moved by `step` [rotation rad, translation mm]."""
    assert A.flange_T_camera is not None
    x = A.flange_T_camera.transform() @ transform_from_vector(step)
    return A.model_copy(update={"id": "b", "flange_T_camera": PoseDocument.of(x)})


def claimed() -> Array:
    assert A.uncertainty is not None
    matrix = A.uncertainty.matrix()
    assert matrix is not None
    return matrix


def test_the_same_agrees_with_itself() -> None:
    found = compare(A, moved(np.zeros(6)))
    assert (found.translation_mm, found.mahalanobis) == (pytest.approx(0, abs=1e-9), pytest.approx(0, abs=1e-4))
    assert found.agree
    assert found.probability == pytest.approx(1.0)


def test_a_camera_that_moved_contradicts_it() -> None:
    found = compare(A, moved(np.array([0.0, 0.0, np.radians(0.5), 0.0, 3.0, 4.0])))
    assert found.agree is False
    assert (found.translation_mm, found.rotation_deg) == (pytest.approx(5.0), pytest.approx(0.5))
    assert found.rotation_about_deg == pytest.approx((0.0, 0.0, 0.5))
    assert max(point.difference_mm for point in found.points) > 4.0
    assert "the camera moved between them, or one of them is wrong" in found.summary.message


def test_two_that_err_as_they_claim_rarely_contradict_each_other() -> None:
    steps = np.random.default_rng(4).multivariate_normal(np.zeros(6), 2 * claimed(), 300)
    found = [compare(A, moved(step), 0.05) for step in steps]
    assert 0.01 < np.mean([not one.agree for one in found]) < 0.10
    assert np.mean([one.mahalanobis**2 for one in found if one.mahalanobis is not None]) == pytest.approx(6, rel=0.2)
    within = [point.difference_mm < (point.expanded_mm or 0) for one in found for point in one.points]
    assert np.mean(within) > 0.93


def test_without_a_covariance_it_says_that_it_is_not_known() -> None:
    found = compare(A, VERSION_1)
    assert (found.agree, found.mahalanobis, found.probability, found.covariance) == (None, None, None, None)
    assert len(found.points) == 27
    assert "is not known" in found.summary.message
    assert compare(VERSION_1, VERSION_1).points == ()


def test_a_singular_covariance_leaves_it_open() -> None:
    assert A.uncertainty is not None
    singular = A.uncertainty.model_copy(update={"covariance": tuple((0.0,) * 6 for _ in range(6))})
    nothing = A.model_copy(update={"uncertainty": singular})
    assert compare(nothing, nothing).agree is None


@pytest.mark.parametrize(
    ("other", "says"),
    [
        (A.model_copy(update={"flange_T_camera": None}), "holds no transform"),
        (
            A.model_copy(update={"setup": "eye-to-hand", "base_T_camera": A.flange_T_camera}),
            "is eye-in-hand and a is eye-to-hand",
        ),
    ],
)
def test_what_cannot_be_compared_is_refused(other: CalibrationDocument, says: str) -> None:
    with pytest.raises(ComparisonError, match=says):
        compare(A, other)


def test_it_is_said_in_words_made_from_id_and_parameters() -> None:
    found = compare(A, moved(np.array([0.0, 0.0, 0.0, 0.0, 3.0, 4.0])))
    assert text_of(found.summary.id, found.summary.params) == found.summary.message
    text = comparison_text(found)
    assert text.startswith("b compared with a: they contradict each other: they are 5 mm and")
    assert all(point.name in text for point in found.points)
