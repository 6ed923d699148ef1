"""What a report says besides its document: the plant's names, the run, pictures. What is None stays a blank."""

from dataclasses import dataclass

from calibration.documents.reports.arm_block import ArmErrors
from calibration.documents.target import TargetDocument


@dataclass(frozen=True)
class Picture:
    """A picture as data: URI (`data:image/jpeg;base64,...`), its size in pixels, and its caption."""

    data_uri: str
    width: int
    height: int
    caption: str


@dataclass(frozen=True)
class VerifiedPoints:
    """A verification: the standard deviation (x, y, z) mm of the target's points over `stations` positions.

    `rows`: (point, sigma x, y, z) of each point of the cross; `expected_mm`: one sigma of a mapped point as the
    calibration states it.
    """

    run_id: str
    at: str
    calibration_id: str
    stations: int
    points: int
    sigma_mm: tuple[float, float, float]
    rows: tuple[tuple[str, tuple[float, float, float]], ...] = ()
    positions: tuple[tuple[str, tuple[tuple[float, float, float], ...]], ...] = ()
    expected_mm: float | None = None


@dataclass(frozen=True)
class DriftedPoint:
    """A point of the control chart."""

    run_id: str
    at: str
    standing: str
    drift_mm: float
    limit_mm: float | None
    scatter_mm: float


@dataclass(frozen=True)
class Drift:
    """The control chart of the calibration in force. `changes`: what may have changed, with chances, in words."""

    calibration_id: str
    standing: str
    points: tuple[DriftedPoint, ...]
    alarm: str | None = None
    changes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ReportContext:
    """Names and serials are those of [report] in the settings; `issued_at`, `applied_at` in ISO 8601."""

    plant: str | None = None
    cell: str | None = None
    robot_model: str | None = None
    robot_serial: str | None = None
    camera_model: str | None = None
    camera_serial: str | None = None
    target: TargetDocument | None = None
    target_serial: str | None = None
    target_certificate: str | None = None
    temperature_c: float | None = None
    carried_out_by: str | None = None
    run_id: str | None = None
    applied_at: str | None = None
    applied_by: str | None = None
    issued_at: str | None = None
    document_sha256: str | None = None
    session_sha256: str | None = None
    pictures: tuple[Picture, ...] = ()
    verification: VerifiedPoints | None = None
    drift: Drift | None = None
    arm: ArmErrors | None = None
