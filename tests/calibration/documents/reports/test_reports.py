"""Reports: what stands in them, what stays a blank, and that nothing in them is run or fetched."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from calibration.documents.calibration import (
    ArmScaleDocument,
    CalibrationDocument,
    FindingDocument,
    PointUncertaintyDocument,
)
from calibration.documents.reports.acceptance_report import (
    MeasuredBall,
    MeasuredPosition,
    ScannerVerification,
    acceptance_report,
)
from calibration.documents.reports.blocks import picture, policy_of
from calibration.documents.reports.calibration_report import calibration_report, point_variances
from calibration.documents.reports.charts import LOOKS, Bar, ChartPoint, bar_chart, control_chart, limit_scale
from calibration.documents.reports.context import Drift, DriftedPoint, Picture, ReportContext, VerifiedPoints
from calibration.documents.reports.numbers import number, places, significant
from calibration.documents.reports.scan_report import Scan, ScannedView, scan_report
from calibration.documents.reports.verification_report import drift_report, verification_report
from calibration.likelihood.mapped_points import point_sigmas_mm
from tests.daemon.calibrations import a_calibration

HOSTILE = "\"'><img src=x onerror=alert(1)><script>alert(2)</script></style></title>{{7*7}} é 漢\u202e"
VERSION_1 = CalibrationDocument.model_validate_json(
    (Path(__file__).parents[1] / "calibration_version_1.json").read_bytes()
)
PIXEL = Picture("data:image/png;base64,iVBORw0KGgo=", 4, 3, "view 1")
VERIFIED = VerifiedPoints(
    "run-9", "2026-11-22T08:00:00Z", "cal-1", 3, 35, (0.0465, 0.0685, 0.0136),
    (("point 1", (0.04, 0.05, 0.01)),), (("point 1", ((1.0, 2.0, 3.0), (1.1, 2.0, 3.0))),), 0.09,
)  # fmt: skip
DRIFT = Drift("cal-1", "steady", (
    DriftedPoint("run-8", "2026-11-21T08:00:00Z", "learning", 0.02, None, 0.03),
    DriftedPoint("run-9", "2026-11-22T08:00:00Z", "drifting", 0.2, 0.1, 0.03),
))  # fmt: skip
SCAN = Scan("scan-1", "door", "2026-11-22T08:00:00Z", "cal-1", 12345, (ScannedView(0, 12345, 0.4, 0.11, 0.02),),
            0.2, 0.11, True, (), (PIXEL,))  # fmt: skip
ACCEPTANCE = ScannerVerification(
    "acc-1", "2026-11-22T08:00:00Z", "Ann", "scan-1", "based on ISO 10360-13", 15.0, 100.0, 0.012, -0.03, 0.15,
    (MeasuredPosition(0, (MeasuredBall((1.0, 2.0, 500.0), 0.012, -0.03, 900),), 0.15),),
)  # fmt: skip
FULL = ReportContext(
    plant="Plant 3", cell="Cell 2", robot_model="IRB 1600", robot_serial="R-1", camera_serial="C-1",
    target_serial="T-1", target_certificate="DKD 1", temperature_c=21.5, run_id="run-1",
    applied_at="2026-11-22", applied_by="Ann", issued_at="2026-11-22", document_sha256="ab" * 32,
    session_sha256="cd" * 32, pictures=(PIXEL,), verification=VERIFIED, drift=DRIFT,
)  # fmt: skip


class Elements(HTMLParser):
    """Elements and attributes of a page, and its text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.attributes: set[tuple[str, str]] = set()
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        self.attributes |= {(name, value or "") for name, value in attrs}

    def handle_data(self, data: str) -> None:
        self.text += data


def every_report(context: ReportContext) -> dict[str, str]:
    return {
        "calibration": calibration_report(VERSION_1, context),
        "verification": verification_report(VERIFIED, context),
        "drift": drift_report(DRIFT, context),
        "scan": scan_report(SCAN, context),
        "acceptance": acceptance_report(ACCEPTANCE, context),
    }


@pytest.mark.parametrize("name", every_report(ReportContext()))
def test_a_report_stands_alone(name: str) -> None:
    html = every_report(FULL)[name]
    page = Elements(html)
    assert not page.names & {"script", "iframe", "object", "embed", "link", "base", "form"}
    assert not [attribute for attribute, _ in page.attributes if attribute.startswith("on") or attribute == "style"]
    assert not [value for attribute, value in page.attributes if attribute in ("src", "href") and "data:" not in value]
    assert "url(" not in html.replace("@page", "")
    assert "default-src 'none'" in policy_of(html)
    assert page.text.count("End of report") == 1


@pytest.mark.parametrize("name", every_report(ReportContext()))
def test_hostile_names_stay_text(name: str) -> None:
    words = {field: HOSTILE for field, value in vars(FULL).items() if isinstance(value, str)}
    hostile = replace(FULL, **words, pictures=(replace(PIXEL, caption=HOSTILE),))
    document = VERSION_1.model_copy(update={"id": HOSTILE, "method": HOSTILE, "software": HOSTILE})
    finding = FindingDocument(code=HOSTILE, severity="error", message=HOSTILE, fix=HOSTILE)
    html = {
        "calibration": calibration_report(document, hostile),
        "verification": verification_report(replace(VERIFIED, run_id=HOSTILE, rows=((HOSTILE, (1, 2, 3)),)), hostile),
        "drift": drift_report(replace(DRIFT, alarm=HOSTILE, calibration_id=HOSTILE), hostile),
        "scan": scan_report(replace(SCAN, name=HOSTILE, scan_id=HOSTILE, findings=(finding,)), hostile),
        "acceptance": acceptance_report(replace(ACCEPTANCE, by=HOSTILE, based_on=HOSTILE), hostile),
    }[name]
    page, plain = Elements(html), Elements(every_report(FULL)[name])
    assert page.names <= plain.names | {"table", "tr", "th", "td", "span"}
    assert not [attribute for attribute, _ in page.attributes if attribute.startswith("on")]
    assert HOSTILE.partition("</style>")[0] in page.text
    assert html.count("</style>") == html.count("<style>") == 1


def test_the_certificate_has_its_numbers() -> None:
    document = CalibrationDocument.model_validate_json(VERSION_1.model_dump_json())
    page = Elements(calibration_report(document, FULL)).text
    x = document.flange_T_camera
    assert x is not None
    assert document.uncertainty is not None
    for value, u in zip(x.translation_mm, document.uncertainty.translation_mm, strict=True):
        assert number(value, places(2 * u)) in page
        assert significant(2 * u) in page
    for q in x.quaternion_wxyz:
        assert number(q, 7) in page
    for word in ("Identification", "Measurand", "Result", "Views", "budget", "Verification", "Traceability", "DKD 1",
                 "k\u00a0=\u00a02", "simple acceptance" if document.verdict.limits else "k", "21.5", "ab" * 32,
                 document.id, "Released by"):  # fmt: skip
        assert word in page, word


def test_the_budget_s_parts_make_up_the_uncertainty_of_the_worst_point() -> None:
    """A turn of 1 mrad about x moves a point 500 mm ahead by 0.5 mm; lengths of the arm known to 0.1 % as well."""
    point = {"name": "middle", "frame": "camera", "position_mm": (0, 0, 500), "camera_mm": (0, 0, 500),
             "sigma_mm": 1.0, "expanded_mm": 2.0}  # fmt: skip
    covariance = np.diag([1e-6, 0, 0, 0.01, 0.01, 0.01])
    covariance[0, 4] = covariance[4, 0] = 1e-5
    assert VERSION_1.uncertainty is not None
    sure = VERSION_1.uncertainty.model_copy(
        update={
            "covariance": covariance.tolist(), "points": (PointUncertaintyDocument.model_validate(point),),
            "arm_scale": ArmScaleDocument(log=6e-4, sigma=8e-4, covariance_with_x=(0, 0, 0, 0, 0, 2e-5)),
        }
    )  # fmt: skip
    document = VERSION_1.model_copy(update={"uncertainty": sure})
    parts = dict(point_variances(covariance, sure.points[0]))
    assert parts["turn of the camera (A)"] == pytest.approx(0.25)
    assert parts["shift of the camera (A)"] == pytest.approx(0.03)
    assert parts["both together (A)"] == pytest.approx(-2 * 500 * 1e-5)
    text = Elements(calibration_report(document, FULL)).text
    assert sum(parts.values()) == pytest.approx(float(point_sigmas_mm(covariance, np.array([[0, 0, 500.0]]))[0]) ** 2)
    whole = sum(parts.values()) + 0.25 + 2 * 500 * 2e-5
    assert f"{0.27 / whole * 100:.0f} %" in text
    assert significant(whole**0.5) in text
    assert f"it is {significant(2 * 1.27**0.5)} mm" in text


def test_what_is_not_known_is_a_blank() -> None:
    html = calibration_report(VERSION_1, ReportContext())
    assert html.count('class="blank"') >= 9
    assert calibration_report(VERSION_1, FULL).count('class="blank"') == 2, "target and temperature"
    assert "not been verified yet" in html


def test_a_refused_and_a_rejected_calibration_say_so() -> None:
    assert "Refused." in calibration_report(a_calibration("a", solved=False), ReportContext())
    rejected = calibration_report(a_calibration("a", accepted=False), ReportContext())
    assert "Not accepted." in rejected
    assert "the axes are parallel" in rejected


def test_an_alarm_of_the_chart_is_the_first_thing_said() -> None:
    html = drift_report(replace(DRIFT, alarm="the target moved by 0.2 mm", standing="drifting"), ReportContext())
    text = Elements(html).text
    assert text.index("Alarm. the target moved") < text.index("Identification")
    assert LOOKS["over"]["fill"] in html
    assert "None" in drift_report(Drift("cal-1", "learning", ()), ReportContext())


def test_only_pictures_of_a_report_s_own_are_shown() -> None:
    with pytest.raises(ValueError, match="data: URI"):
        picture(Picture("https://elsewhere.example/x.png", 1, 1, ""))


@pytest.mark.parametrize(("value", "u", "text"), [
    (45.250196, 0.0381, "45.250"), (-7.20025, 0.045, "\u22127.200"), (1266.23, 1.24, "1266.2"), (0.0001, 12.0, "0"),
])  # fmt: skip
def test_a_value_ends_where_its_uncertainty_does(value: float, u: float, text: str) -> None:
    assert number(value, places(u)) == text


@pytest.mark.parametrize(("value", "text"), [(0.0381, "0.038"), (0.00999, "0.0100"), (12.4, "12"), (None, "\u2014"),
                                              (float("nan"), "\u2014"), (0.0, "0"), (1234.0, "1234")])  # fmt: skip
def test_two_digits_of_an_uncertainty(value: float | None, text: str) -> None:
    assert significant(value) == text


def test_charts_stay_within_their_frame() -> None:
    bars = [Bar(str(index), 10.0**index, index == 4) for index in range(5)]
    points = [ChartPoint(str(index), 0.1 * index, None if index < 2 else 0.5, index > 3) for index in range(30)]
    for chart in (bar_chart(bars, "mm", "a"), control_chart(points, "mm", "b"), limit_scale(9.0, 4.0, "mm", "c"),
                  control_chart(points[:1], "mm", "d"), bar_chart([Bar("0", 0.0)], "mm", "e")):  # fmt: skip
        width, height = (float(number) for number in re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', chart)[0])
        for x, y in re.findall(r' c?x="(-?[\d.]+)" c?y="(-?[\d.]+)"', chart):
            assert 0 <= float(x) <= width
            assert 0 <= float(y) <= height
