"""Bodies have the types that openapi.json says, and names are printable."""

import json
from typing import Any

import pytest

from calibration.documents.validation import validate_json
from calibration.errors import DocumentError
from daemon.model.requests import ApplyRequest, CalibrateRequest, ScanRequest, SetupRequest, VerifyRequest
from tests.daemon.cell_under_test import Bench, pose_json
from tests.daemon.fakes import poses_around_the_target

POSES = [pose_json(pose) for pose in poses_around_the_target(3)]
CHESSBOARD = {"kind": "chessboard", "columns": 11, "rows": 8, "pitch_mm": 20}

OF_ANOTHER_TYPE: list[tuple[type[Any], dict[str, Any]]] = [
    (CalibrateRequest, {"count": "3"}),
    (CalibrateRequest, {"count": 3.5}),
    (CalibrateRequest, {"count": True}),
    (CalibrateRequest, {"manual": "yes"}),
    (CalibrateRequest, {"manual": 1}),
    (CalibrateRequest, {"uncertainty_mm": "0.1"}),
    (CalibrateRequest, {"uncertainty_mm": True}),
    (CalibrateRequest, {"tolerance_mm": 0}),
    (CalibrateRequest, {"tolerance_mm": 1001}),
    (CalibrateRequest, {"target": {**CHESSBOARD, "columns": "11"}}),
    (CalibrateRequest, {"poses": [{**POSES[0], "translation_mm": ["1", 2, 3]}, *POSES]}),
    (CalibrateRequest, {"poses": {"0": POSES[0], "1": POSES[1], "2": POSES[2]}}),
    (VerifyRequest, {"scan_id": 3, "artefact": {"radius_mm": 25.0}}),
    (ScanRequest, {"capture": "on"}),
    (ScanRequest, {"name": 4711}),
    (ApplyRequest, {"despite_verdict": "true"}),
    (SetupRequest, {"code": 1234}),
]


@pytest.mark.parametrize(("model", "body"), OF_ANOTHER_TYPE)
def test_a_value_of_another_type_is_refused(model: type[Any], body: dict[str, Any]) -> None:
    with pytest.raises(DocumentError):
        validate_json(model, body, "request body")


@pytest.mark.parametrize(
    "body",
    [{"count": 3}, {"count": 3.0}, {"uncertainty_mm": 1}, {"poses": POSES}, {"target": CHESSBOARD}, {"manual": True}],
)
def test_a_value_of_its_type_is_taken(body: dict[str, Any]) -> None:
    validate_json(CalibrateRequest, body, "request body")


async def test_the_interface_is_as_strict(bench: Bench) -> None:
    for path, body in (("/calibrate", {"count": "3"}), ("/scans", {"capture": "on"})):
        refused = await bench.client.post(path, json=body)
        assert (refused.status_code, refused.json()["code"]) == (422, "document-refused")
    assert not bench.robot.goals


@pytest.mark.parametrize("depth", [100, 300, 400, 500, 700, 900, 990])
async def test_nested_bodies_are_refused(bench: Bench, depth: int) -> None:
    for body in ("[" * depth + "]" * depth, '{"count":' * depth + "1" + "}" * depth):
        assert (await bench.client.post("/calibrate", content=body)).status_code in (400, 422)


UNPRINTABLE = ["\x9b2J", "\x85", "\u202e", "\u2066", "\u200b", "\u2028", "\ufeff", "\xad", "\U000e0041", "\ud800"]


@pytest.mark.parametrize("mark", UNPRINTABLE, ids=ascii)
async def test_names_are_printable(bench: Bench, mark: str) -> None:
    for path, body in (("/scans", {"name": f"door{mark}"}), ("/calibrations/c/apply", {"applied_by": f"Ann{mark}"})):
        refused = await bench.client.post(path, content=json.dumps(body))
        assert (refused.status_code, refused.json()["code"]) == (422, "document-refused"), path


async def test_names_in_other_scripts_are_taken(bench: Bench) -> None:
    for name in ("Tür 4711", "門 七", "дверь", "باب", ""):
        assert (await bench.client.post("/scans", json={"name": name})).status_code == 201
