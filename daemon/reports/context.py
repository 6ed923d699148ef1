"""What a report says besides its document: the plant's names, the run, pictures. What is None stays a blank."""

from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.arm_field import ArmFieldDocument, arm_field
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.target import TargetDocument
from calibration.errors import GeometryError
from calibration.sentences.sentence import LanguageTag
from daemon.config.report_settings import ReportSettings

if TYPE_CHECKING:  # the daemon's modules are on Linux only; `handeyed report` is not
    from daemon.drift.chart import DriftChart
    from daemon.model.records import RunRecord

FIELD_STEPS = 5
"""Places of the flange along one edge of the arm's field."""


@dataclass(frozen=True)
class Picture:
    """A picture as data: URI (`data:image/jpeg;base64,...`), its size in pixels, and the id of its caption's words with
    what fills them."""

    data_uri: str
    width: int
    height: int
    caption: str
    params: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DeviationMap:
    """How far each point of a scan lies from the other views, mm, positive towards its camera.

    `picture`: coloured up to `end_mm`; `shares`: of the points that several views see, around each of `middles_mm`;
    `alone`: share of the points that one view only sees.
    """

    picture: Picture
    end_mm: float
    middles_mm: tuple[float, ...]
    shares: tuple[float, ...]
    rms_mm: float
    alone: float


@dataclass(frozen=True)
class ReportContext:
    """`names`: [report] of the settings; `issued_at`, `applied_at` in ISO 8601; `verification`: the last one's run.

    `arm`, `arm_field`: the errors of the arm that are in use, and by how much they move registered points.
    """

    language: LanguageTag = "en"
    names: ReportSettings = field(default_factory=ReportSettings)
    robot_model: str | None = None
    target: TargetDocument | None = None
    run_id: str | None = None
    applied_at: str | None = None
    applied_by: str | None = None
    issued_at: str | None = None
    document_sha256: str | None = None
    session_sha256: str | None = None
    pictures: tuple[Picture, ...] = ()
    verification: "RunRecord | None" = None
    drift: "DriftChart | None" = None
    arm: ArmErrorsDocument | None = None
    arm_field: ArmFieldDocument | None = None


def shown_field(document: CalibrationDocument, errors: ArmErrorsDocument) -> ArmFieldDocument | None:
    """The field of the arm's errors; None where none were taken up, and where the views hold no joints."""
    try:
        field = arm_field(errors, document, FIELD_STEPS) if errors.taken_up else None
    except GeometryError:
        return None
    return field if field is not None and field.points else None


def session_sha256(folder: Path) -> str | None:
    """SHA-256 over names and contents of the session's files in `folder`, sorted; None when there is none."""
    files = sorted(file for file in folder.iterdir() if file.is_file()) if folder.is_dir() else []
    files = [file for file in files if file.name == "session.json" or file.suffix in (".png", ".ply", ".npz")]
    if not files:
        return None
    digest = sha256()
    for file in files:
        digest.update(f"{file.name}\0{sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()
