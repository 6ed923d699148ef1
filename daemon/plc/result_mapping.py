"""From what a run found to what a PLC is told."""

from dataclasses import replace
from datetime import datetime

from calibration.documents.calibration import CalibrationDocument
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from protocols.plc.codes import Command, Verdict
from protocols.plc.error_codes import UNKNOWN, number_of
from protocols.plc.results import Camera, Result, Sigma
from registration.documents import RegistrationReportDocument


def ended_badly(command: Command, run: RunRecord) -> Result:
    """A run that failed or was aborted."""
    verdict = Verdict.ABORTED if run.state is RunState.ABORTED else Verdict.FAILED
    code = number_of(run.cause.code) if run.cause else UNKNOWN
    return Result(command, verdict, run.id, code, run.station)


def failed(command: Command, run_id: str, error_code: int) -> Result:
    """A command whose result could not be fetched."""
    return Result(command, Verdict.FAILED, run_id, error_code)


def calibrated(run: RunRecord, document: CalibrationDocument, now: datetime) -> Result:
    """X, and its hold-out error."""
    deviation_mm = document.hold_out.base_error_mm if document.hold_out else None
    found = about(Command.CALIBRATE, run, document, now)
    return replace(found, verdict=judged(document.verdict.accepted), deviation_mm=deviation_mm)


def verified(run: RunRecord, document: CalibrationDocument, now: datetime, holds: bool) -> Result:
    """The calibration in force, and how far the target's points scatter with it."""
    assert run.result is not None
    sigma_mm = run.result["verification"]["sigma_mm"]
    found = about(Command.VERIFY, run, document, now)
    return replace(found, verdict=judged(holds), deviation_mm=float(max(sigma_mm)))


def registered(
    run: RunRecord, document: CalibrationDocument, now: datetime, report: RegistrationReportDocument
) -> Result:
    """The calibration used, and how well the views fit."""
    rms = report.rms_mm
    deviation_mm = rms.before if rms.after is None else rms.after
    found = about(Command.REGISTER, run, document, now)
    return replace(found, verdict=judged(report.verdict.accepted), deviation_mm=deviation_mm)


def about(command: Command, run: RunRecord, document: CalibrationDocument, now: datetime) -> Result:
    """What every result says of its calibration."""
    camera = sigma = None
    if document.flange_T_camera is not None:
        camera = Camera(document.flange_T_camera.translation_mm, document.flange_T_camera.quaternion_wxyz)
    if document.uncertainty is not None:
        told = document.uncertainty
        sigma = Sigma(told.translation_mm, told.rotation_deg, told.point_mm)
    age_s = age_of(document, now)
    return Result(command, Verdict.NONE, run.id, 0, run.station, age_s, camera, sigma)


def age_of(document: CalibrationDocument, now: datetime) -> int:
    """Whole seconds since it was made; 0 when the clock says that it lies ahead."""
    return max(0, int((now - datetime.fromisoformat(document.created_at)).total_seconds()))


def judged(good: bool) -> Verdict:
    return Verdict.ACCEPTED if good else Verdict.REJECTED
