"""Reports: what stands in them, in each language, what stays a blank, and that nothing in them is run or fetched."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from pydantic import TypeAdapter

from calibration.documents.calibration import (
    ArmScaleDocument,
    CalibrationDocument,
    FindingDocument,
    PointUncertaintyDocument,
)
from calibration.documents.numbers import number, places, significant
from calibration.documents.target import TargetDocument
from calibration.likelihood.mapped_points import point_sigmas_mm
from calibration.monitoring.cell_change import DriftChangeDocument
from calibration.monitoring.control_chart import DriftStanding
from calibration.sentences.sentence import LANGUAGES, LanguageTag
from daemon.config.report_settings import ReportSettings
from daemon.drift.chart import DriftChart, DriftPointDocument, DriftReport
from daemon.model.records import RunRecord, ScanRecord
from daemon.model.run_states import RunState
from daemon.reports.charts import LOOKS, Bar, ChartPoint, bar_chart, control_chart, limit_scale
from daemon.reports.context import Picture, ReportContext
from daemon.reports.pages import TEMPLATES, WORDS, policy_of
from daemon.reports.reports import (
    acceptance_report,
    calibration_report,
    drift_report,
    point_variances,
    scan_report,
    verification_report,
)
from daemon.store.documents import DocumentRecord
from registration.documents import RegistrationReportDocument
from tests.daemon.calibrations import a_calibration, document_with_covariance
from tests.daemon.records import an_acceptance

HOSTILE = "\"'><img src=x onerror=alert(1)><script>alert(2)</script></style></title>{{7*7}} é 漢\u202e"
VERSION_1 = CalibrationDocument.model_validate_json(
    (Path(__file__).parents[2] / "calibration" / "documents" / "calibration_version_1.json").read_bytes()
)
AT = "2026-11-22T08:00:00Z"
PIXEL = Picture("data:image/png;base64,iVBORw0KGgo=", 4, 3, "picture.used", {"view": 1})
VERIFIED = RunRecord("run-9", "verify", RunState.FINISHED, 3, 3, AT, AT, result={"verification": {
    "calibration_id": "cal-1", "stations": [[1.0], [2.0], [3.0]], "frame": "base", "cross": [1],
    "points": [{"id": 1, "sigma_mm": [0.04, 0.05, 0.01], "base_mm": [[1.0, 2.0, 3.0], [1.1, 2.0, 3.0]]}],
    "sigma_mm": [0.0465, 0.0685, 0.0136], "expected_point_mm": 0.09,
}})  # fmt: skip
CHANGES = (DriftChangeDocument("axis-zero", 0.9, axis=2, turned_deg=0.02), DriftChangeDocument("nothing", 0.1))
DRIFT = DriftChart(DriftReport("steady", "cal-1"), (
    DriftPointDocument("run-8", "2026-11-21T08:00:00Z", "learning", (0, 0, 0), (0, 0, 0), 0.02, None, 0.03),
    DriftPointDocument("run-9", AT, "drifting", (0, 0, 0), (0, 0, 0), 0.2, 0.1, 0.03),
), CHANGES)  # fmt: skip
SCAN = ScanRecord("scan-1", AT, "door")
REGISTERED = RegistrationReportDocument.model_validate({
    "calibration_id": "cal-1", "points": 12345, "rms_mm": {"before": 0.2, "after": 0.11},
    "views": [{"index": 0, "cloud": "a.ply", "points": 12345, "overlap": 0.4, "rms_mm": 0.11, "free_directions": [],
               "base_T_camera": {"translation_mm": [0, 0, 0], "quaternion_wxyz": [1, 0, 0, 0]},
               "correction": {"translation_mm": [0.02, 0, 0], "rotation_deg": [0, 0, 0]}}],
    "verdict": {"accepted": True, "findings": []}, "seconds": {"read": 1, "register": 1, "write": 1},
})  # fmt: skip
MEASURED = an_acceptance("scan-1")
ACCEPTANCE = DocumentRecord("acc-1", "scan-1", AT, "Ann", MEASURED.model_dump_json())
NAMES = ReportSettings(plant="Plant 3", cell="Cell 2", robot_serial="R-1", camera_serial="C-1", target_serial="T-1",
                       target_certificate="DKD 1")  # fmt: skip
FULL = ReportContext(
    names=NAMES, robot_model="IRB 1600", run_id="run-1", applied_at="2026-11-22", applied_by="Ann",
    issued_at="2026-11-22", document_sha256="ab" * 32, session_sha256="cd" * 32, pictures=(PIXEL,),
    verification=VERIFIED, drift=DRIFT,
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
        "scan": scan_report(SCAN, REGISTERED, context, (PIXEL,)),
        "acceptance": acceptance_report(ACCEPTANCE, MEASURED, context),
    }


NAMES_OF_REPORTS = ("calibration", "verification", "drift", "scan", "acceptance")


@pytest.mark.parametrize("name", NAMES_OF_REPORTS)
def test_a_report_stands_alone(name: str) -> None:
    html = every_report(FULL)[name]
    page = Elements(html)
    assert not page.names & {"script", "iframe", "object", "embed", "link", "base", "form"}
    assert not [attribute for attribute, _ in page.attributes if attribute.startswith("on") or attribute == "style"]
    assert not [value for attribute, value in page.attributes if attribute in ("src", "href") and "data:" not in value]
    assert "url(" not in html.replace("@page", "")
    assert "default-src 'none'" in policy_of(html)
    assert ("content", policy_of(html).removesuffix("; frame-ancestors 'none'")) in page.attributes
    assert page.text.count("End of report") == 1


@pytest.mark.parametrize("name", NAMES_OF_REPORTS)
def test_hostile_names_stay_text(name: str) -> None:
    words = {field: HOSTILE for field, value in vars(FULL).items() if isinstance(value, str) and field != "language"}
    names = ReportSettings.model_construct(**dict.fromkeys(ReportSettings.model_fields, HOSTILE))
    hostile = replace(FULL, **words, names=names, pictures=(replace(PIXEL, params={"view": HOSTILE}),))
    document = VERSION_1.model_copy(update={"id": HOSTILE, "method": HOSTILE, "software": HOSTILE})
    finding = FindingDocument(code=HOSTILE, severity="error", message=HOSTILE, fix=HOSTILE)
    verdict = REGISTERED.verdict.model_copy(update={"findings": [finding]})
    alarm = replace(DRIFT, report=replace(DRIFT.report, alarm=HOSTILE, calibration_id=HOSTILE))
    html = {
        "calibration": calibration_report(document, hostile),
        "verification": verification_report(replace(VERIFIED, id=HOSTILE, updated_at=HOSTILE), hostile),
        "drift": drift_report(alarm, hostile),
        "scan": scan_report(
            ScanRecord(HOSTILE, AT, HOSTILE), REGISTERED.model_copy(update={"verdict": verdict}), hostile, (PIXEL,)
        ),
        "acceptance": acceptance_report(replace(ACCEPTANCE, id=HOSTILE, created_by=HOSTILE), MEASURED, hostile),
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
    for word in ("Identification", "Measurand", "Result", "Pictures", "budget", "Quick check", "Traceability", "DKD 1",
                 "k = 2", "simple acceptance" if document.verdict.limits else "k", "ab" * 32,
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
    parts = point_variances(covariance, sure.points[0])
    assert parts["budget.turn"] == pytest.approx(0.25)
    assert parts["budget.shift"] == pytest.approx(0.03)
    assert parts["budget.both"] == pytest.approx(-2 * 500 * 1e-5)
    text = Elements(calibration_report(document, FULL)).text
    assert sum(parts.values()) == pytest.approx(float(point_sigmas_mm(covariance, np.array([[0, 0, 500.0]]))[0]) ** 2)
    whole = sum(parts.values()) + 0.25 + 2 * 500 * 2e-5
    assert f"{0.27 / whole * 100:.0f} %" in text
    assert significant(whole**0.5) in text
    assert f"it is {significant(2 * 1.27**0.5)} mm" in text


def test_what_is_not_known_is_a_blank() -> None:
    html = calibration_report(VERSION_1, ReportContext())
    assert html.count('class="blank"') >= 9
    assert calibration_report(VERSION_1, FULL).count('class="blank"') == 3, "target, and temperature twice"
    assert "No quick check of this calibration" in html


def test_a_refused_and_a_rejected_calibration_say_so() -> None:
    assert "Refused." in calibration_report(a_calibration("a", solved=False), ReportContext())
    rejected = calibration_report(a_calibration("a", accepted=False), ReportContext())
    assert "Not accepted." in rejected
    assert "the axes are parallel" in rejected


def test_an_alarm_of_the_chart_is_the_first_thing_said() -> None:
    report = DriftReport("drifting", "cal-1", alarm="the target moved by 0.2 mm")
    html = drift_report(replace(DRIFT, report=report), ReportContext())
    text = Elements(html).text
    assert text.index("Alarm. the target moved") < text.index("Identification")
    assert LOOKS["over"]["fill"] in html
    assert "axis 2 of the arm: its zero moved by 0.020 deg (chance 90%)" in text
    assert "No quick check yet." in drift_report(DriftChart(DriftReport("learning")), ReportContext())


def test_the_temperature_stands_beside_each_view_where_one_is_known() -> None:
    warm = [view.model_copy(update={"camera_temperature_c": 21.5}) for view in VERSION_1.views]
    for views, shown in ((VERSION_1.views, False), (warm, True)):
        text = Elements(calibration_report(VERSION_1.model_copy(update={"views": views}), ReportContext())).text
        assert ("camera / °C" in text) is shown
        assert ("21.5" in text) is shown


def test_only_pictures_of_a_report_s_own_are_shown() -> None:
    elsewhere = replace(PIXEL, data_uri="https://elsewhere.example/x.png")
    with pytest.raises(ValueError, match="data: URI"):
        scan_report(SCAN, REGISTERED, ReportContext(), (elsewhere,))


def test_charts_stay_within_their_frame() -> None:
    bars = [Bar(str(index), 10.0**index, index == 4) for index in range(5)]
    points = [ChartPoint(str(index), 0.1 * index, None if index < 2 else 0.5, index > 3) for index in range(30)]
    for chart in (bar_chart(bars, "mm"), control_chart(points, "mm"), limit_scale(9.0, 4.0, "tolerance 4 mm"),
                  control_chart(points[:1], "mm"), bar_chart([Bar("0", 0.0)], "mm")):  # fmt: skip
        placed = [each.attributes for each in chart.shapes if {"x", "y"} <= each.attributes.keys()]
        placed += [
            {"x": dot["cx"], "y": dot["cy"]} for dot in (each.attributes for each in chart.shapes) if "cx" in dot
        ]
        assert placed
        for at in placed:
            assert 0 <= float(at["x"]) <= chart.width
            assert 0 <= float(at["y"]) <= chart.height


# --- languages ---

GRID = {"columns": 4, "rows": 3}
TARGETS: tuple[dict[str, object], ...] = (
    {"kind": "chessboard", **GRID, "pitch_mm": 20.5},
    {"kind": "charuco", **GRID, "square_mm": 30.0, "marker_mm": 22.5, "dictionary": "DICT_5X5_100"},
    {"kind": "circles", **GRID, "layout": "symmetric", "pitch_mm": 12.5},
    {"kind": "apriltag-grid", **GRID, "tag_mm": 40.5, "gap_mm": 8.0},
    {"kind": "aruco-grid", **GRID, "marker_mm": 40.5, "gap_mm": 8.0, "dictionary": "DICT_5X5_100"},
    {"kind": "aruco-marker", "marker_mm": 99.5, "dictionary": "DICT_5X5_100", "id": 3},
)


def words_in(language: LanguageTag) -> dict[str, str]:
    words: dict[str, str] = json.loads((WORDS / f"{language}.json").read_text(encoding="utf-8"))
    return words


def test_no_word_is_left_over() -> None:
    sources = [*TEMPLATES.glob("*.html"), *TEMPLATES.parent.glob("*.py")]
    text = "\n".join(source.read_text(encoding="utf-8") for source in sources)
    used = set(re.findall(r"""["']([a-z]+\.[\w-]+)["']""", text))
    families = {  # put together of a kind and a value of a document
        "report.": ("error", "warning", "info", "base", "camera"),
        "drift.": ("off", *get_args(DriftStanding)),
        "calibration.": ("eye-in-hand", "eye-to-hand", "used", "corrected", "rejected"),
        "target.": ("pitch", "square", "marker", "tag", "gap"),
        "budget.by-": ("image", "pose", "view"), "id.intrinsics-": ("given", "estimated"),
        "change.": ("nothing", "camera-moved", "target-moved", "axis-zero"), "scan.": ("above", "front", "side"),
    }  # fmt: skip
    used |= {f"{name}.title" for name in NAMES_OF_REPORTS} | {kind + one for kind in families for one in families[kind]}
    assert words_in("en").keys() - used == set()


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", NAMES_OF_REPORTS)
def test_a_report_is_in_its_language_alone(name: str, language: LanguageTag) -> None:
    page = Elements(every_report(replace(FULL, language=language))[name])
    words = words_in(language)
    assert ("lang", language) in page.attributes
    assert words["report.identification"] in page.text
    assert words[f"{name}.title"] in page.text
    english = {
        text for text in set(words_in("en").values()) - set(words.values()) if len(text) > 12 and "{" not in text
    }
    assert language == "en" or not [text for text in english if text in page.text]


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_was_expected_what_was_got_and_what_was_before_stand_together(language: LanguageTag) -> None:
    beside = {"expected_mm": 0.31, "before_mm": 0.52}
    document = document_with_covariance()
    document = document.model_copy(update={"accuracy": document.accuracy.model_copy(update=beside)})
    text = " ".join(Elements(calibration_report(document, ReportContext(language=language))).text.split())
    in_words = [words_in(language)[f"calibration.{name}"] for name in ("expected", "before")]
    decimal = "." if language in ("en", "zh") else ","
    for words, U in zip(in_words, ("0.31", "0.52"), strict=True):
        assert words.replace("{U}", U.replace(".", decimal)) in text


def test_findings_and_numbers_are_in_the_language_of_the_report() -> None:
    stored = {
        "code": "image-noise",
        "severity": "warning",
        "message": "the corners scatter by 0.53 px",
        "fix": "x",
        "id": "image-noise",
        "params": {"image_px": 0.53},
        "advice": {"id": "as-written", "params": {"sentence": "x"}},
    }
    verdict = VERSION_1.verdict.model_validate({"accepted": False, "findings": [stored, {**stored, "id": "of-2031"}]})
    document = VERSION_1.model_copy(update={"verdict": verdict})
    german = Elements(calibration_report(document, ReportContext(language="de"))).text
    assert "die Ecken streuen um 0,53 px" in german
    assert german.count("the corners scatter by 0.53 px") == 1, "a sentence that German has not stays as it was written"
    x = document.flange_T_camera
    assert x is not None
    for q in x.quaternion_wxyz:
        assert number(q, 7).replace(".", ",") in german


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: str(target["kind"]))
def test_every_target_is_described_in_every_language(target: dict[str, object]) -> None:
    document: TargetDocument = TypeAdapter(TargetDocument).validate_python(target)
    for language in LANGUAGES:
        text = Elements(calibration_report(VERSION_1, ReportContext(language=language, target=document))).text
        assert str(target["kind"]) in text
        for size in (value for name, value in target.items() if name.endswith("_mm")):
            assert f"{size:g} mm".replace(".", "," if language in ("de", "es") else ".") in text
