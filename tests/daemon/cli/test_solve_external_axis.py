"""`handeyed solve` of a session on a track that the controller leaves out of its poses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import BUILT_TRACK, TRAVEL_MM, on_a_track, with_corners


def test_the_direction_is_in_the_calibration_and_said(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a", on_a_track()), "--json")
    document = CalibrationDocument.model_validate_json(ran.out)
    assert (ran.status, document.verdict.accepted) == (0, True)
    found = document.external_axis
    assert found is not None
    assert (found.kind, found.number, found.readings) == ("track", 2, (0.0, TRAVEL_MM))
    assert np.abs(found.axis().direction - BUILT_TRACK.direction).max() < 2e-4
    assert found.off_deg == pytest.approx(0.29, abs=0.02)
    assert any("the track moves the base along" in finding.message for finding in document.verdict.findings)


@pytest.mark.parametrize(
    ("axis", "place", "what"),
    [
        ({"number": 3}, "views[5].external_axes", "it holds no axis 3"),
        ({"direction": [0, 0, 0]}, "external_axis", "direction is a vector"),
        ({"direction": [1e200, 0, 0]}, "external_axis", "direction is a vector"),
        ({"kind": "turntable"}, "external_axis", "point_mm"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, axis: dict[str, Any], place: str, what: str) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a", on_a_track(**axis)))
    assert ran.status == 2
    assert place in ran.err
    assert what in ran.err
