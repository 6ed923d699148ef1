"""Schemas of calibrations: the list, the active one, the status. Lengths in mm."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from calibration.documents.calibration import AccuracyDocument, CalibrationDocument
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, as_it_stands, example
from daemon.api.schemas.runs import RunDocument
from daemon.model.records import AppliedCalibration, CalibrationRecord
from daemon.store.listings import CalibrationListing

EXAMPLE_ACCURACY = {
    "expanded_mm": 0.23, "worst_point": "far top left", "tolerance_mm": 0.5, "tolerance_stated": True,
    "expected_mm": 0.18, "before_mm": 0.26, "why": None,
}  # fmt: skip


class CalibrationSummary(AccuracyDocument, Answer):
    """One line of the list. `current`: active for its `camera`, which is by its name in the settings.

    The rest is its accuracy: U (k = 2, mm) at the worst of the points that matter, beside what it is judged by.
    """

    model_config = example(
        id=EXAMPLE_ID,
        run_id=EXAMPLE_ID,
        created_at=EXAMPLE_AT,
        accepted=True,
        current=True,
        camera="camera",
        **EXAMPLE_ACCURACY,
    )

    id: str
    run_id: str | None
    created_at: str
    accepted: bool
    current: bool
    camera: str

    @classmethod
    def of(
        cls, row: CalibrationListing | CalibrationRecord, accuracy: AccuracyDocument, *, current: bool
    ) -> "CalibrationSummary":
        return cls(
            id=row.id, run_id=row.run_id, created_at=row.created_at, accepted=row.accepted, current=current,
            camera=row.camera, **vars(accuracy),
        )  # fmt: skip


@dataclass(frozen=True)
class AppliedDocument(AppliedCalibration):
    """An entry of the history of active calibrations. `sequence` counts from 1.

    `role`: of who applied it; `despite_verdict`: it was not accepted, `reason`: why it was applied;
    `camera`: by its name in the settings.
    """

    __pydantic_config__: ClassVar = as_it_stands(
        calibration_id=EXAMPLE_ID, applied_at=EXAMPLE_AT, applied_by="Ann", sequence=7, role="operator",
        despite_verdict=False, reason="", camera="camera",
    )  # fmt: skip


class CalibrationList(Answer):
    """The newest first, and the last calibrations that were applied. `damaged`: ids of rows that cannot be read."""

    calibrations: list[CalibrationSummary]
    damaged: list[str]
    applied: list[AppliedDocument]
    next: str | None


class CurrentCalibration(AccuracyDocument, Answer):
    """The active calibration, since when and by whom, and its accuracy as it is now."""

    applied: AppliedDocument
    calibration: CalibrationDocument


class CalibrateStatus(Answer):
    """Where calibration stands, and how to start. `warnings`: what is not checked before the arm moves.

    `fastest_mm_s`: largest speed of flange, camera and carried points in a move, however the flange turns; null when
    the robot's program does not say how it limits turning.
    """

    current: CalibrationSummary | None
    applied: AppliedDocument | None
    in_progress: RunDocument | None
    last_run: RunDocument | None
    ready: bool
    reasons: list[str]
    policy: Literal["operator", "auto"]
    poses: str
    how_to_start: str
    warnings: list[str]
    fastest_mm_s: float | None


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


class ExportList(Answer):
    """Every format of a calibration and of the poses it was taken from."""

    exports: list[ExportDocument]
