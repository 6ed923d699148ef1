"""Settings of earlier versions start the daemon, and mean what they say."""

import pytest

from calibration.errors import DocumentError
from daemon.config.settings import parse_settings

EARLIER = """
[robot]
address = "tcp://10.0.0.2:5000"
box_mm = [[200, -600, 50], [1100, 600, 1200]]

[camera]
address = "http://127.0.0.1:1/image"

[target]
kind = "chessboard"
columns = 11
rows = 8
pitch_mm = 20.0

[report]
plant = "Plant 3"
pitch_uncertainty_mm = 0.005
"""


def test_the_uncertainty_of_a_pitch_for_the_report_is_a_certificate_of_the_target() -> None:
    found = parse_settings(EARLIER.encode(), "handeyed.toml")
    assert found.report.plant == "Plant 3"
    assert found.calibration.known.target.source == "certified"
    assert found.calibration.known.target.knowledge().size_sigma == pytest.approx(0.005 / 20.0)


def test_it_is_refused_where_it_is_no_length() -> None:
    with pytest.raises(DocumentError, match="uncertainty_mm"):
        parse_settings(EARLIER.replace("0.005", '"fine"').encode(), "handeyed.toml")
