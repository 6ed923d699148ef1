"""The PDF of a report: PDF/A-3u with its document attached, the same bytes for the same report."""

import os
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from importlib import import_module

from daemon.tools.reports.errors import ReportExtraMissing

RESOURCES = ("data",)
"""Schemes of what a report may load: its own pictures. Everything else is refused."""


@dataclass(frozen=True)
class Attached:
    """A file within the PDF."""

    name: str
    content: bytes
    about: str


def write_pdf(html: str, attached: Attached | None = None) -> bytes:
    """The PDF of a report's HTML. Raises ReportExtraMissing without WeasyPrint or the libraries that it needs."""
    try:
        weasyprint, urls = import_module("weasyprint"), import_module("weasyprint.urls")
    except (ImportError, OSError):
        raise ReportExtraMissing from None
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
