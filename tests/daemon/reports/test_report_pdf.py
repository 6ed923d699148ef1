"""The PDF of a report: same bytes twice, its numbers as text, calibration.json attached, nothing fetched."""

import io
import os
from pathlib import Path

import pytest

from calibration.documents.numbers import number
from daemon.config.report_settings import ReportSettings
from daemon.reports.context import ReportContext
from daemon.reports.errors import ReportExtraMissing
from daemon.reports.pdf import Attached, write_pdf
from daemon.reports.reports import calibration_report
from tests.daemon.calibrations import a_calibration

pytestmark = [  # WeasyPrint 70 leaves its colour profile open
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]

DOCUMENT = a_calibration("20261122-090000-abc123")
CONTENT = DOCUMENT.model_dump_json().encode()
HTML = calibration_report(DOCUMENT, ReportContext(names=ReportSettings(plant="Plant 3")))


def written(html: str = HTML) -> bytes:
    pytest.importorskip("weasyprint", reason="the extra `report` is not installed")
    try:
        return write_pdf(html, Attached("calibration.json", CONTENT, "the calibration"))
    except ReportExtraMissing:
        pytest.skip("Pango is not here (Debian: libpango-1.0-0, libpangoft2-1.0-0)")


@pytest.mark.slow
def test_the_same_report_gives_the_same_bytes() -> None:
    assert written() == written()


@pytest.mark.slow
def test_the_pdf_says_what_the_report_says_and_holds_the_calibration() -> None:
    pypdf = pytest.importorskip("pypdf")
    content = written()
    reader = pypdf.PdfReader(io.BytesIO(content))
    text = " ".join(page.extract_text() for page in reader.pages)
    assert DOCUMENT.flange_T_camera is not None
    for q in DOCUMENT.flange_T_camera.quaternion_wxyz:
        assert number(q, 7) in text
    for word in ("Plant 3", DOCUMENT.id, f"page 1 of {len(reader.pages)}", "End of report"):
        assert word in text, word
    assert reader.attachments["calibration.json"] == [CONTENT]
    assert b"pdfaid:part" in reader.trailer["/Root"]["/Metadata"].get_data()
    assert reader.trailer["/Root"]["/MarkInfo"]["/Marked"]


@pytest.mark.parametrize("address", ["http://127.0.0.1:9/x.png", "file:///etc/hostname", "ftp://127.0.0.1/x"])
def test_nothing_is_fetched(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    urlopen = pytest.importorskip("urllib.request")
    opened: list[object] = []
    monkeypatch.setattr(urlopen.OpenerDirector, "open", lambda self, request, *rest: opened.append(request))
    monkeypatch.setattr(urlopen, "urlopen", lambda request, *rest: opened.append(request))
    html = HTML.replace("<main>", f'<main><img src="{address}"><link rel="stylesheet" href="{address}">')
    assert written(html).startswith(b"%PDF")
    assert not [each for each in opened if "data:" not in str(each)]


@pytest.mark.parametrize(("fonts", "refused"), [("Noto Sans CJK SC", False), ("", True)])
def test_a_report_in_chinese_without_a_font_for_it_is_refused(
    fonts: str, refused: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would print empty boxes."""
    program = tmp_path / "fc-list"
    program.write_text(f"#!/bin/sh\necho '{fonts}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    html = calibration_report(DOCUMENT, ReportContext(language="zh"))
    if not refused:
        assert written(html).startswith(b"%PDF")
        return
    pytest.importorskip("weasyprint", reason="the extra `report` is not installed")
    with pytest.raises(ReportExtraMissing) as found:
        write_pdf(html)
    assert "fonts-noto-cjk" in found.value.fix
