"""Records as a store holds them."""

import json
from pathlib import Path

from daemon.model.records import RunRecord
from daemon.model.requests import ArtefactRequest
from daemon.model.run_states import RunState
from daemon.scans.scanner_acceptance import AcceptanceDocument
from daemon.store.database import DATABASE_NAME
from registration.points.scanner_acceptance import PositionDocument, ProbedBall

AT = "2026-11-21T09:00:00.000Z"


def a_run(run_id: str, state: RunState = RunState.MOVING) -> RunRecord:
    return RunRecord(run_id, "calibration", state, 1, 3, AT, AT, request={"count": 3})


def names_in(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir() if not file.name.startswith(DATABASE_NAME))


def a_touch_test() -> str:
    """Of ten points."""
    pose = {"translation_mm": [900.0, 0.0, 500.0], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}
    numbers = {"length_mm": 0.2, "expanded_mm": 0.2, "claimed_mm": 0.2, "miss_mm": [0.2, 0.0, 0.0]}
    places = {"seen_mm": [900.0, 0.0, 300.0], "touched_mm": [900.2, 0.0, 300.0]}
    point = {"name": "hole", **places, **numbers, "outlying": False, "base_T_flange": pose}
    result = {
        "calibration_id": "cal-1", "flange_tip_mm": [0.0, 0.0, 200.0], "points": [point] * 10, "largest_mm": 0.2,
        "mean_mm": [0.0, 0.1, 0.1], "probability": 0.5, "agree": True, "tolerance_mm": None, "conformance": None,
        "accepted": True, "summary": "10 points",
    }  # fmt: skip
    tip = {"flange_tip_mm": [0.0, 0.0, 200.0], "covariance": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "placing_sigma_mm": 0.1}
    touches = {"touches": [{"id": 1, "base_T_flange": pose}] * 10}
    stored = {"tip": tip, "touches": touches, "verification": None, "result": result}
    return json.dumps(stored)


def an_acceptance(scan_id: str) -> AcceptanceDocument:
    """Of ten views of a ball bar."""
    ball = ProbedBall(centre_mm=(0.0, 0.0, 500.0), form_mm=0.1, size_mm=0.05, points=2000)
    seen = [PositionDocument(view=k, balls=(ball, ball), spacing_error_mm=0.02) for k in range(10)]
    artefact = ArtefactRequest(radius_mm=25.0, spacing_mm=200.0)
    return AcceptanceDocument(
        based_on="ISO 10360-13", scan_id=scan_id, artefact=artefact, probing_form_mm=0.1, probing_size_mm=0.05,
        sphere_spacing_mm=0.02, positions=seen,
    )  # fmt: skip
