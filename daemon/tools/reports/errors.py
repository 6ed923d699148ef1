"""The error of a report that needs WeasyPrint."""

from daemon.errors import DaemonError


class ReportExtraMissing(DaemonError):
    """The extra `report` is not installed, or Pango is missing."""

    code = "report-extra-missing"

    def __init__(self) -> None:
        super().__init__(
            "a report as PDF needs the extra `report`, which is not installed here",
            "install handeyed[report] (and Debian's libpango-1.0-0, libpangoft2-1.0-0), or print the HTML report",
        )
