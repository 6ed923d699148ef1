"""Schemas of GET /calibrations/{id}/exports."""

from calibration.documents.exports.formats import ExportFormat, PoseFormat
from daemon.api.schemas.answer import EXAMPLE_ID, Answer, example


class ExportDocument(Answer):
    """One format: the name to save the file under, its media type, and where it is."""

    model_config = example(
        format="ros-tf", file="tf_static.yaml", media_type="application/yaml",
        about="tf2_msgs/TFMessage for /tf_static", href=f"/calibrations/{EXAMPLE_ID}/exports/ros-tf",
    )  # fmt: skip

    format: str
    file: str
    media_type: str
    about: str
    href: str

    @classmethod
    def of(cls, known: ExportFormat | PoseFormat, calibration_id: str) -> "ExportDocument":
        href = f"/calibrations/{calibration_id}/exports/{known.name}"
        return cls(**vars(known), format=known.name, href=href)


class ExportList(Answer):
    """Every format of a calibration and of the poses it was taken from."""

    exports: list[ExportDocument]
