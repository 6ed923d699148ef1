"""The context of a report from settings, records and files."""

from hashlib import sha256
from pathlib import Path
from typing import Any

from calibration.documents.reports.context import ReportContext, VerifiedPoints
from daemon.config.settings import Settings
from daemon.model.records import RunRecord


def context_of(settings: Settings) -> ReportContext:
    """Names, serials and target of the settings."""
    return ReportContext(robot_model=settings.robot.model_name, target=settings.target, **settings.report.model_dump())


def verified_points(run: RunRecord) -> VerifiedPoints:
    """The result of a finished verification."""
    assert run.result is not None
    found: dict[str, Any] = run.result["verification"]
    by_id, frame = {point["id"]: point for point in found["points"]}, found.get("frame", "base")
    cross = [by_id[point] for point in found["cross"] if point in by_id]
    return VerifiedPoints(
        run_id=run.id,
        at=run.updated_at,
        calibration_id=found["calibration_id"],
        stations=len(found["stations"]),
        points=len(found["points"]),
        sigma_mm=tuple(found["sigma_mm"]),
        rows=tuple((f"point {point['id']}", tuple(point["sigma_mm"])) for point in cross),
        positions=tuple((f"point {point['id']}", tuple(map(tuple, point[f"{frame}_mm"]))) for point in cross),
        expected_mm=found.get("expected_point_mm"),
    )


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
