"""The PDF of a report: same bytes twice, its numbers as text, calibration.json attached, nothing fetched."""

import io
import os
from itertools import cycle
from pathlib import Path

import pytest

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.numbers import number
from calibration.sentences.sentence import LANGUAGES, LanguageTag
from daemon.config.report_settings import ReportSettings
from daemon.reports.context import ReportContext
from daemon.reports.pdf import Attached, ReportExtraMissing, write_pdf
from daemon.reports.reports import calibration_report
from tests.daemon.calibrations import a_calibration

pytestmark = [  # WeasyPrint 70 leaves its colour profile open
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]

VERSION_1 = CalibrationDocument.model_validate_json(
    (Path(__file__).parents[2] / "calibration" / "documents" / "calibration_version_1.json").read_bytes()
)
DOCUMENT = a_calibration("20261122-090000-abc123")
CONTENT = DOCUMENT.model_dump_json().encode()
HTML = calibration_report(DOCUMENT, ReportContext(names=ReportSettings(plant="Plant 3")))


def with_views(count: int, language: LanguageTag) -> str:
    """The report of a calibration with so many rows in its table of views."""
    views = tuple(view.model_copy(update={"index": index}) for index, view in zip(range(count), cycle(VERSION_1.views)))
    return calibration_report(VERSION_1.model_copy(update={"views": views}), ReportContext(language=language))


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


def pages_of_tables(html: str) -> list[set[int]]:
    """Of each table, the pages on which parts of it are."""
    weasyprint = pytest.importorskip("weasyprint", reason="the extra `report` is not installed")
    pages: dict[int, set[int]] = {}
    for sheet, page in enumerate(weasyprint.HTML(string=html).render().pages, start=1):
        for box in page._page_box.descendants():
            if box.element_tag == "table":
                pages.setdefault(id(box.element), set()).add(sheet)
    return list(pages.values())


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_no_table_is_broken_over_two_pages(language: LanguageTag) -> None:
    for views in (5, 15, 25, 40):
        html = with_views(views, language)
        assert "counter(page)" in html and "counter(pages)" in html, "pages are numbered"
        tables = pages_of_tables(html)
        assert len(tables) >= 5 and len(set.union(*tables)) >= 2
        assert [pages for pages in tables if len(pages) > 1] == [], views


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
