"""Rows of the tables of runs, calibrations and scans as records."""

import json
from typing import Any

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.pose import PoseDocument
from daemon.errors import StorageInconsistent
from daemon.model.records import CalibrationRecord, Cause, RunRecord, ScanRecord, ScanViewRecord
from daemon.model.run_states import RunState
from daemon.store.damaged_rows import parse_row, parse_stored


def read_calibration(row: tuple[Any, ...]) -> CalibrationRecord:
    """The record of a row. Raises StorageInconsistent when its document is not what was stored."""
    calibration_id, run_id, created_at, accepted, content, *named = row
    document = parse_stored(CalibrationDocument, content, f"calibration {calibration_id}")
    return CalibrationRecord(calibration_id, run_id, created_at, bool(accepted), document, *named)


def read_run_or_failed(row: Any) -> RunRecord:
    """The record of a row; of a damaged one only id and times, failed."""
    try:
        return parse_row(RunRecord.of, row, "run")
    except StorageInconsistent as error:
        cause = Cause(error.code, error.what, error.fix)
        return RunRecord(str(row[0]), row[1], RunState.FAILED, 0, 0, str(row[8]), str(row[9]), cause)


def read_scan(row: tuple[Any, ...]) -> ScanRecord:
    """The record of a row."""
    scan_id, created_at, name, refine, *scanner = row
    return ScanRecord(scan_id, created_at, name, bool(refine), *scanner)


def read_scan_view(row: tuple[Any, ...]) -> ScanViewRecord:
    """The record of a row. Raises ValueError for a damaged one."""
    view, file, unit, pose, created_at, *axes, points, size_bytes, created_by = row
    joints_deg, external_axes = (values and tuple(json.loads(values)) for values in axes)
    at = PoseDocument.model_validate_json(pose)
    return ScanViewRecord(view, file, unit, at, created_at, joints_deg, external_axes, points, size_bytes, created_by)


def scan_view_row(scan_id: str, view: ScanViewRecord) -> tuple[Any, ...]:
    """The row of a record."""
    axes = (None if values is None else json.dumps(values) for values in (view.joints_deg, view.external_axes))
    return (scan_id, view.view, view.file, view.unit, view.base_T_flange.model_dump_json(), view.created_at, *axes,
            view.points, view.bytes, view.created_by)  # fmt: skip
