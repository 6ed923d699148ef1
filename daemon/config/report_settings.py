"""Settings of reports; `handeyed report` reads them where the daemon does not run."""

from typing import Annotated

from pydantic import Field

from calibration.documents.validation import Document

Name = Annotated[str, Field(min_length=1, max_length=120, pattern=r"^[^\x00-\x1f\x7f]+$")]


class ReportSettings(Document):
    """Names for reports. What is left out stays a blank in them, to be filled in by hand."""

    plant: Name | None = None
    cell: Name | None = None
    robot_serial: Name | None = None
    camera_model: Name | None = None
    camera_serial: Name | None = None
    target_serial: Name | None = None
    target_certificate: Name | None = None
