"""calibration.json: what version 2 holds, that version 1 is read, and that docs/ describes it as it is."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import COVARIANCE_ORDER, CalibrationDocument, calibration_document
from calibration.documents.requirement import LimitsInForceDocument
from calibration.documents.validation import parse_document
from calibration.errors import DocumentError
from calibration.likelihood.mapped_points import point_sigmas_mm
from calibration.sentences.sentence import AS_WRITTEN, text_of
from calibration.transforms import transform_from_vector
from calibration.verdict import VerdictLimits, judge
from tests.calibration.documents.schema_file import FILE, calibration_schema
from tests.simulated.spoiled_sessions import solved_session

PROBLEM, SOLVED = solved_session()
LIMITS = VerdictLimits().with_tolerance(0.001)
DOCUMENT = calibration_document(
    SOLVED, judge(PROBLEM, SOLVED, LIMITS), calibration_id="c1", created_at="now", software="handeyed 0"
)
VERSION_1 = (Path(__file__).parent / "calibration_version_1.json").read_bytes()


def sentences_in(document: CalibrationDocument) -> list[tuple[str, dict[str, Any], str]]:
    """Every sentence of a document: its id, its parameters, and the English beside them."""
    content = json.loads(document.model_dump_json())
    findings = content["verdict"]["findings"]
    reasons = [view["reason_detail"] for view in content["views"] if view["reason_detail"]]
    if content["verdict"]["rule"]:
        reasons.append(content["verdict"]["rule"])
    return [
        *((found["id"], found["params"], found["message"]) for found in findings),
        *((found["advice"]["id"], found["advice"]["params"], found["fix"]) for found in findings),
        *((reason["id"], reason["params"], reason["message"]) for reason in reasons),
    ]


def test_it_holds_the_covariance_with_frame_and_order() -> None:
    uncertainty = DOCUMENT.uncertainty
    assert uncertainty is not None
    matrix = uncertainty.matrix()
    assert matrix is not None
    assert SOLVED.uncertainty is not None
    np.testing.assert_array_equal(matrix, SOLVED.uncertainty.covariance)
    assert (uncertainty.covariance_frame, uncertainty.covariance_order) == ("camera", COVARIANCE_ORDER)
    np.testing.assert_allclose(np.degrees(np.sqrt(np.diag(matrix)[:3])), uncertainty.rotation_deg)
    assert SOLVED.mount_T_camera is not None
    to_mount = SOLVED.mount_T_camera[:3, :3]
    along_mount = to_mount @ matrix[3:, 3:] @ to_mount.T
    np.testing.assert_allclose(np.sqrt(np.diag(along_mount)), uncertainty.translation_mm)


def test_the_covariance_is_of_x_followed_by_a_small_motion() -> None:
    """A reader moves X by steps drawn from it, and finds the uncertainty of the points."""
    uncertainty = DOCUMENT.uncertainty
    assert uncertainty is not None
    matrix = uncertainty.matrix()
    assert matrix is not None
    steps = np.random.default_rng(3).multivariate_normal(np.zeros(6), matrix, 3000)
    point = np.array([*uncertainty.points[0].position_mm, 1.0])
    off_mm = [np.linalg.norm((transform_from_vector(step) @ point - point)[:3]) for step in steps]
    assert np.sqrt(np.mean(np.square(off_mm))) == pytest.approx(uncertainty.points[0].sigma_mm, rel=0.05)
    assert uncertainty.points[0].expanded_mm == uncertainty.coverage_factor * uncertainty.points[0].sigma_mm
    assert point_sigmas_mm(matrix, point[None, :3])[0] == pytest.approx(uncertainty.points[0].sigma_mm)


def test_it_holds_the_limits_in_force_and_the_rule() -> None:
    verdict = DOCUMENT.verdict
    assert verdict.limits is not None
    assert verdict.limits.tolerance_mm == 0.001
    assert set(LimitsInForceDocument.model_fields) == {
        name.replace("_rad", "_deg") for name in VerdictLimits.__dataclass_fields__
    }
    assert verdict.rule is not None
    assert verdict.rule.params == {"coverage_factor": 2.0, "tolerance_mm": 0.001}
    assert not verdict.accepted


def test_every_sentence_is_made_from_its_id_and_parameters() -> None:
    found = sentences_in(DOCUMENT)
    assert len(found) >= 3
    for sentence_id, params, english in found:
        assert sentence_id != AS_WRITTEN
        assert text_of(sentence_id, params) == english


def test_version_1_is_read() -> None:
    old = json.loads(VERSION_1)
    document = parse_document(CalibrationDocument, VERSION_1, "old.json")
    assert document.schema_version == 2
    assert document.uncertainty is not None
    assert (document.uncertainty.covariance, document.uncertainty.points) == (None, ())
    assert (document.verdict.limits, document.verdict.rule) == (None, None)
    kept = json.loads(document.model_dump_json())
    assert kept["flange_T_camera"] == old["flange_T_camera"]
    assert [found["message"] for found in kept["verdict"]["findings"]] == [
        found["message"] for found in old["verdict"]["findings"]
    ]
    for sentence_id, params, english in sentences_in(document):
        assert (sentence_id, text_of(sentence_id, params)) == (AS_WRITTEN, english)
    assert CalibrationDocument.model_validate_json(document.model_dump_json()) == document


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"schema_version": 3}, "schema_version"),
        ({"verdict": 7}, "verdict"),
        ({"verdict": {"accepted": True, "findings": [7]}}, "verdict.findings[0]"),
        ({"uncertainty": {"point_mm": 0.1}}, "uncertainty.translation_mm"),
    ],
)
def test_a_damaged_version_1_is_refused_with_its_place(change: dict[str, Any], place: str) -> None:
    content = json.dumps({**json.loads(VERSION_1), **change}).encode()
    with pytest.raises(DocumentError) as refused:
        parse_document(CalibrationDocument, content, "old.json")
    assert place in {problem.place for problem in refused.value.problems}


@pytest.mark.parametrize(
    ("section", "place", "fix"),
    [
        (
            {"base_eror_mm": 0.3, "base_error_mm": 0.3, "reprojection_px": None},
            "hold_out.base_eror_mm",
            "base_error_mm",
        ),
        (0.3, "hold_out", "give an object"),
    ],
)
def test_a_section_that_is_a_result_itself_is_refused_as_any_other(section: Any, place: str, fix: str) -> None:
    content = {**json.loads(DOCUMENT.model_dump_json()), "hold_out": section}
    with pytest.raises(DocumentError) as refused:
        parse_document(CalibrationDocument, json.dumps(content).encode(), "new.json")
    (problem,) = refused.value.problems
    assert problem.place == place
    assert fix in problem.fix


def test_the_schema_in_docs_is_that_of_the_model() -> None:
    assert json.loads(FILE.read_text()) == calibration_schema(), "python -m tests.calibration.documents.schema_file"


def test_the_page_in_docs_names_every_field() -> None:
    page = (FILE.parent / "calibration-json.md").read_text()
    schema = calibration_schema()
    models = [schema, *schema["$defs"].values()]
    missing = {name for model in models for name in model.get("properties", {}) if f"`{name}`" not in page}
    assert not missing
