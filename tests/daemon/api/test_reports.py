"""GET /calibrations/{id}/report, /runs/{id}/report, /drift/report, /scans/{id}/report.html."""

from pathlib import Path
from threading import Event

import cv2
import numpy as np
import pytest

from calibration.documents.numbers import number
from daemon.model.records import CalibrationRecord
from daemon.reports import pdf
from daemon.reports.pdf import ReportExtraMissing
from tests.daemon.calibrations import a_calibration, an_arm, apply_calibration, with_views
from tests.daemon.cell_under_test import Bench, serving, settings_for
from tests.daemon.clouds import PLY, POSES, cloud
from tests.daemon.fakes import ply_of
from tests.daemon.scans.scan_folders import a_scan

NAMED = {"plant": "Plant <b>3</b>", "robot_serial": "R-17", "target_certificate": "DKD-1"}


async def test_the_report_of_the_one_in_force(tmp_path: Path) -> None:
    async with serving(settings_for(tmp_path, report=NAMED)) as bench:
        await apply_calibration(bench)
        for which in ("current", "cal-1"):
            answer = await bench.client.get(f"/calibrations/{which}/report", headers={"accept": "text/html"})
            assert answer.headers["content-type"] == "text/html; charset=utf-8"
            policy = answer.headers["content-security-policy"]
            assert "unsafe" not in policy
            assert "default-src 'none'" in policy
            for word in ("Plant &lt;b&gt;3&lt;/b&gt;", "R-17", "DKD-1", "active since"):
                assert word in answer.text
        document = (await bench.client.get("/calibrations/cal-1")).json()
        assert all(number(q, 7) in answer.text for q in document["flange_T_camera"]["quaternion_wxyz"])


@pytest.mark.parametrize(
    ("asked", "accepted", "answered"),
    [
        ({}, None, "en"), ({}, "de-AT,de;q=0.9,en;q=0.5", "de"), ({}, "fr, es;q=0.2", "es"), ({}, "fr", "en"),
        ({}, "de;q=0", "en"), ({"language": "zh"}, "de", "zh"),
    ],
)  # fmt: skip
async def test_a_report_is_in_the_language_that_is_asked_for_or_preferred(
    bench: Bench, asked: dict[str, str], accepted: str | None, answered: str
) -> None:
    await apply_calibration(bench)
    headers = {} if accepted is None else {"Accept-Language": accepted}
    answer = await bench.client.get("/calibrations/current/report", params=asked, headers=headers)
    assert answer.headers["content-language"] == answered
    assert f'<html lang="{answered}">' in answer.text
    assert "Accept-Language" in answer.headers["vary"]


async def test_a_language_that_no_report_has_is_refused(bench: Bench) -> None:
    await apply_calibration(bench)
    refused = await bench.client.get("/calibrations/current/report?language=fr")
    assert refused.status_code == 422
    assert "en, de, es or zh" in refused.json()["fix"].replace("'", "")


@pytest.mark.slow
async def test_a_run_s_calibration_is_reported_with_its_pictures_and_then_verified(bench: Bench) -> None:
    run = await bench.client.post("/calibrate", json={"count": 4}, params={"wait": 200})
    calibration_id = run.json()["result"]["calibration_id"]
    before = (await bench.client.get(f"/calibrations/{calibration_id}/report")).text
    assert "data:image/jpeg;base64," in before
    assert "No quick check of this calibration" in before
    assert "not at hand" not in before, "the session has a hash"
    applied = await bench.client.post(f"/calibrations/{calibration_id}/apply", json={"applied_by": "Ann"})
    assert applied.status_code == 200, applied.text
    await bench.verify()
    verified = (await bench.client.get("/drift")).json()["points"][-1]["run_id"]
    report = await bench.client.get(f"/runs/{verified}/report")
    assert report.status_code == 200, report.text
    for word in (verified, calibration_id, "In order.", "standard deviation over", "Drift"):
        assert word in report.text
    chart = await bench.client.get("/drift/report")
    assert verified in chart.text
    assert "Quick check" in (await bench.client.get(f"/calibrations/{calibration_id}/report")).text
    other = await bench.client.get(f"/runs/{run.json()['id']}/report")
    assert (other.status_code, f"/calibrations/{calibration_id}/report" in other.json()["fix"]) == (404, True)


async def test_a_scan_is_shown_from_three_sides_with_its_deviations(bench: Bench) -> None:
    await apply_calibration(bench)
    scan = await a_scan(bench)
    for pose in POSES[:2]:
        sent = await bench.client.post(
            scan["links"]["views"], params={"pose": pose, "unit": "mm"}, content=ply_of(cloud(3000)), headers=PLY
        )
        assert sent.status_code == 201, sent.text
    for side, width, accept, size in (
        ("front", None, "image/png", 480),
        ("above", 240, "image/webp", 240),
        ("side", 1920, "image/jpeg", 960),
    ):
        asked = {"from": side} | ({} if width is None else {"width": width})
        picture = await bench.client.get(f"/scans/{scan['id']}/picture", params=asked, headers={"Accept": accept})
        assert (picture.status_code, picture.headers["content-type"]) == (200, accept)
        image = cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        assert image.shape == (size, size, 3)
        assert (image < 230).any(axis=2).sum() > 500, "points are drawn"
    report = await bench.client.get(f"/scans/{scan['id']}/report.html")
    assert report.status_code == 200, report.text
    assert report.text.count("data:image/png;base64,") == 4  # three sides, and the map of deviations
    assert "Share of the points by their deviation in mm" in report.text


async def test_the_field_of_the_arms_errors_is_in_the_report_of_its_calibration(bench: Bench) -> None:
    for name, document, shown in (
        ("no-joints", a_calibration("no-joints"), False),
        ("joints", with_views(a_calibration("joints")), True),
    ):
        record = CalibrationRecord(name, None, document.created_at, True, document)
        await bench.application.store.save_calibration(record, an_arm(zero_2=1e-3))
        report = await bench.client.get(f"/calibrations/{name}/report")
        assert report.status_code == 200, report.text
        assert ("The arm as built" in report.text) is shown
    columns = {
        tuple(point["flange_mm"][:2])
        for point in (await bench.client.get("/calibrations/joints/arm/field")).json()["points"]
    }
    assert report.text.count("<circle") == 2 * len(columns) > 20


async def test_without_the_extra_a_pdf_is_refused_with_the_way_out(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_: object) -> bytes:
        raise ReportExtraMissing

    await apply_calibration(bench)
    monkeypatch.setattr("daemon.api.routes.reports.write_pdf", missing)
    refused = await bench.client.get("/calibrations/cal-1/report", headers={"accept": "application/pdf"})
    assert (refused.status_code, refused.json()["code"]) == (406, "report-extra-missing")
    assert "handeyed[report]" in refused.json()["fix"]
    assert pdf.RESOURCES == ("data",)


async def test_a_pdf_that_takes_too_long_is_refused_and_no_defect(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    ended = Event()

    def endless(*_: object) -> bytes:
        ended.wait()
        return b""

    await apply_calibration(bench)
    monkeypatch.setattr("daemon.api.routes.reports.write_pdf", endless)
    monkeypatch.setattr("daemon.api.routes.reports.MAX_PDF_S", 0.0)
    try:
        refused = await bench.client.get("/calibrations/cal-1/report", params={"format": "pdf"})
    finally:
        ended.set()
    assert (refused.status_code, refused.json()["code"]) == (429, "report-too-slow")
    assert "Traceback" not in caplog.text


async def test_what_has_no_report_is_refused(bench: Bench) -> None:
    for path, status in (("/calibrations/nothing/report", 404), ("/runs/nothing/report", 404),
                         ("/drift/report", 404), ("/scans/nothing/report.html", 409)):  # fmt: skip
        assert (await bench.client.get(path)).status_code == status, path
    assert (await bench.client.get("/calibrations/current/report?format=doc")).status_code == 422
