"""Errors of reports as PDF."""

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
