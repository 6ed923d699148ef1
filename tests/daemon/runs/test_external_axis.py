"""What a cell with a track that the controller leaves out of its poses refuses."""

import pytest

from calibration.documents.external_axis import ExternalAxisDocument
from daemon.cell.arm_in_cell import ArmInCell
from daemon.errors import CalibrationUnusable, NoPoses
from daemon.model.requests import CalibrateRequest
from daemon.runs.pose_selection import require_by_hand
from tests.daemon.calibrations import a_calibration

TRACK = ExternalAxisDocument(kind="track", direction=(0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("request_", "fix"),
    [
        (CalibrateRequest(), "calibrate by hand"),
        (CalibrateRequest(manual=True, arm=True), "leave together and arm out"),
    ],
)
def test_a_run_that_would_not_find_the_axis(request_: CalibrateRequest, fix: str) -> None:
    require_by_hand(None, request_)
    with pytest.raises(NoPoses) as refused:
        require_by_hand(TRACK, request_)
    assert fix in refused.value.fix


def test_a_calibration_that_knows_no_track_places_nothing_on_one() -> None:
    with pytest.raises(CalibrationUnusable, match="made without the track"):
        ArmInCell(TRACK).in_use(a_calibration("early"), None)
