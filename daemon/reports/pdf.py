"""The PDF of a report: PDF/A-3u with its document attached, the same bytes for the same report."""

import os
import shutil
import subprocess
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from importlib import import_module

from daemon.errors import DaemonError


class ReportExtraMissing(DaemonError, code="report-extra-missing"):
    """The extra `report` is not installed, or Pango is missing, or a font with the letters of the report's language."""

    def __init__(
        self,
        needed: str = "the extra `report`",
        package: str = "handeyed[report] (and Debian's libpango-1.0-0, libpangoft2-1.0-0)",
    ) -> None:
        what = f"a report as PDF needs {needed}, which is not installed here"
        super().__init__(what, f"install {package}, or print the HTML report")


class ReportTooSlow(DaemonError, code="report-too-slow"):
    """A PDF was not written within its limit: the PC works on others, or is busy."""

    def __init__(self, limit_s: float) -> None:
        what = f"the PDF was not written within {limit_s:g} s"
        super().__init__(what, "ask again in some seconds, or print the HTML report")


RESOURCES = ("data",)
"""Schemes of what a report may load: its own pictures. Everything else is refused."""

MAX_FONTS_S = 5.0


@dataclass(frozen=True)
class Attached:
    """A file within the PDF."""

    name: str
    content: bytes
    about: str


def write_pdf(html: str, attached: Attached | None = None) -> bytes:
    """The PDF of a report's HTML. Raises ReportExtraMissing without WeasyPrint or the libraries and fonts it needs."""
    try:
        weasyprint, urls = import_module("weasyprint"), import_module("weasyprint.urls")
    except (ImportError, OSError):
        raise ReportExtraMissing from None
    if '<html lang="zh">' in html and not _has_chinese_font():
        raise ReportExtraMissing("a font with Chinese characters", "Debian's fonts-noto-cjk")
    os.environ.setdefault("SOURCE_DATE_EPOCH", "0")  # the time that fontTools writes into each font
    then = datetime.fromtimestamp(0, UTC)  # no clock: the same report gives the same bytes
    fetcher = urls.URLFetcher(allowed_protocols=RESOURCES)
    given = (
        []
        if attached is None
        else [
            weasyprint.Attachment(
                string=attached.content, name=attached.name, description=attached.about, created=then, modified=then,
                relationship="Source", url_fetcher=fetcher,
            )
        ]
    )  # fmt: skip
    content: bytes = weasyprint.HTML(string=html, base_url=None, url_fetcher=fetcher).write_pdf(
        pdf_variant="pdf/a-3u", pdf_tags=True, pdf_identifier=sha256(html.encode()).hexdigest()[:32].encode(),
        attachments=given,
    )  # fmt: skip
    return content


def _has_chinese_font() -> bool:
    """Whether fontconfig, by which WeasyPrint chooses fonts, has one; without one it prints empty boxes."""
    program = shutil.which("fc-list")
    if program is None:
        return True  # it cannot be known
    listed = subprocess.run([program, ":lang=zh", "family"], capture_output=True, timeout=MAX_FONTS_S, check=False)
    return listed.returncode != 0 or bool(listed.stdout.strip())
