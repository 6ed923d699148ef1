"""Map runs and their documents to the result registers of the PLC."""

from dataclasses import replace
from datetime import datetime

from calibration.documents.calibration import AccuracyDocument, CalibrationDocument
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from protocols.plc.codes import PlcCommand, PlcVerdict
from protocols.plc.error_codes import UNKNOWN, number_of
from protocols.plc.results import Accuracy, CameraPose, CommandResult, Sigma
from registration.documents import RegistrationReportDocument


def run_failure(command: PlcCommand, run: RunRecord) -> CommandResult:
    """The result of a run that failed or was aborted."""
    verdict = PlcVerdict.ABORTED if run.state is RunState.ABORTED else PlcVerdict.FAILED
    code = number_of(run.cause.code) if run.cause else UNKNOWN
    return CommandResult(command, verdict, run.id, code, run.station)


def command_failure(command: PlcCommand, run_id: str, error_code: int) -> CommandResult:
    """The result of a command whose run ended but whose result could not be read."""
    return CommandResult(command, PlcVerdict.FAILED, run_id, error_code)


def calibration_result(run: RunRecord, document: CalibrationDocument, now: datetime) -> CommandResult:
    """The result of a calibration: X, and its hold-out error as the deviation."""
    assert run.result is not None
    deviation_mm = document.hold_out.base_error_mm if document.hold_out else None
    found = base_result(PlcCommand.CALIBRATE, run, document, now)
    verdict = verdict_of(document.verdict.accepted)
    return replace(found, verdict=verdict, deviation_mm=deviation_mm, in_force=run.result["applied"])


def verification_result(run: RunRecord, document: CalibrationDocument, now: datetime, holds: bool) -> CommandResult:
    """The result of a verification: the active calibration, and the largest sigma of the target's points."""
    assert run.result is not None
    sigma_mm = run.result["verification"]["sigma_mm"]
    found = base_result(PlcCommand.VERIFY, run, document, now)
    return replace(found, verdict=verdict_of(holds), deviation_mm=float(max(sigma_mm)))


def registration_result(
    run: RunRecord, document: CalibrationDocument, now: datetime, report: RegistrationReportDocument
) -> CommandResult:
    """The result of a registration: the calibration used, and the RMS between views, refined if they were."""
    rms = report.rms_mm
    deviation_mm = rms.before if rms.after is None else rms.after
    found = base_result(PlcCommand.REGISTER, run, document, now)
    return replace(found, verdict=verdict_of(report.verdict.accepted), deviation_mm=deviation_mm)


def base_result(command: PlcCommand, run: RunRecord, document: CalibrationDocument, now: datetime) -> CommandResult:
    """The fields common to all results: run, X, its uncertainty and accuracy, and age; of an active calibration."""
    camera = sigma = None
    if document.mount_T_camera is not None:
        camera = CameraPose(document.mount_T_camera.translation_mm, document.mount_T_camera.quaternion_wxyz)
    if document.uncertainty is not None:
        uncertainty = document.uncertainty
        sigma = Sigma(uncertainty.translation_mm, uncertainty.rotation_deg, uncertainty.point_mm)
    age_s = age_of(document, now)
    return CommandResult(
        command, PlcVerdict.NONE, run.id, 0, run.station, age_s, camera, sigma, accuracy=_accuracy(document.accuracy),
        in_force=True,
    )  # fmt: skip


def _accuracy(stated: AccuracyDocument) -> Accuracy:
    return Accuracy(
        stated.expanded_mm, stated.worst_point or "", stated.tolerance_mm, stated.tolerance_stated, stated.expected_mm,
        stated.before_mm, unexpected=stated.why is not None,
    )  # fmt: skip


def age_of(document: CalibrationDocument, now: datetime) -> int:
    """Whole seconds since the calibration was made; 0 when that lies in the future."""
    return max(0, int((now - datetime.fromisoformat(document.created_at)).total_seconds()))


def verdict_of(good: bool) -> PlcVerdict:
    return PlcVerdict.ACCEPTED if good else PlcVerdict.REJECTED
