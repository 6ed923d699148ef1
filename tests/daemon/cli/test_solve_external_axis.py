"""`handeyed solve` of a session on a track that the controller leaves out of its poses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.kinematics.external_axis import ExternalAxis
from calibration.transforms import inverse
from tests.daemon.cli.running import handeyed
from tests.daemon.cli.sessions import Change, with_corners

BUILT = ExternalAxis("track", 2, np.array([0.004, 0.99999, -0.003]), np.zeros(3))
GIVEN = {"kind": "track", "number": 2, "direction": [0, 1, 0]}
TRAVEL_MM = 1500.0


def on_a_track(**axis: Any) -> Change:
    """The session as the controller reports it, every other view from 1500 mm."""

    def change(document: dict[str, Any]) -> None:
        document["external_axis"] = {**GIVEN, **axis}
        for index, view in enumerate(document["views"]):
            reading = TRAVEL_MM * (index % 2)
            at_zero = PoseDocument.model_validate(view["base_T_flange"]).transform()
            reported = inverse(BUILT.motion(reading)) @ at_zero
            view["base_T_flange"] = PoseDocument.of(reported).model_dump(mode="json")
            view["external_axes"] = [None, reading]

    return change


def test_the_direction_is_in_the_calibration_and_said(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a", on_a_track()), "--json")
    document = CalibrationDocument.model_validate_json(ran.out)
    assert (ran.status, document.verdict.accepted) == (0, True)
    found = document.external_axis
    assert found is not None
    assert (found.kind, found.number, found.readings) == ("track", 2, (0.0, TRAVEL_MM))
    assert np.abs(found.axis().direction - BUILT.direction).max() < 2e-4
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


def test_the_errors_of_an_arm_are_not_found_while_an_axis_moves(tmp_path: Path) -> None:
    ran = handeyed("solve", with_corners(tmp_path / "a", on_a_track()), "--arm", "IRB 1600-6/1.45")
    assert ran.status == 2
    assert "not found while an external axis moves" in ran.err
