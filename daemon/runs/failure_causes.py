"""Causes of failed runs: code, sentence and fix for the operator."""

from calibration.errors import CalibrationError, DetectionError, DocumentError, UndeterminedError
from daemon.errors import DaemonError
from daemon.model.records import Cause, RunRecord
from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, LinkLost

LINK_ERRORS = (LinkLost, DeviceTimeout, DeviceUnreachable)
LINK_FIX = "check the cable and that the cell program runs, see GET /robot; then start the run again"


def progress_text(run: RunRecord) -> str:
    """The progress of a run in words, such as "after station 4 of 12"."""
    if run.station == 0:
        return f"before station 1 of {run.stations}"
    return f"after station {run.station} of {run.stations}"


def cause_of(error: Exception, run: RunRecord) -> Cause:
    """The cause for an exception that ended the run."""
    match error:
        case DeviceError() if isinstance(error, LINK_ERRORS) and error.kind in (None, "robot"):
            return Cause("link-lost", f"link to the controller lost {progress_text(run)}", f"{LINK_FIX} ({error.what})")
        case DeviceError():
            return Cause(error.code, f"{error.device}: {error.what} ({progress_text(run)})", error.fix)
        case DaemonError():
            return Cause(error.code, f"{error.what} ({progress_text(run)})", error.fix)
        case DetectionError() | UndeterminedError():
            return Cause(error.code, f"{error.what} ({progress_text(run)})", error.fix)
        case DocumentError():
            return Cause("document", "; ".join(str(problem) for problem in error.problems), "correct it, and run again")
        case CalibrationError():
            return Cause(
                "calibration-error", f"{error} ({progress_text(run)})", "look at the stored pictures and poses"
            )
        case _:
            return Cause(
                "internal-error",
                f"a defect of handeyed ended the run {progress_text(run)}: {type(error).__name__}: {error}",
                "report it with the log; what was captured is stored",
            )


def abort_cause(by: str, run: RunRecord) -> Cause:
    """The cause of a run that was aborted."""
    return Cause("aborted", f"aborted by {by} {progress_text(run)}", "start it again when the cell is ready")


def interruption_cause(run: RunRecord, folder: str) -> Cause:
    """The cause of a run whose daemon ended during it."""
    return Cause(
        "interrupted",
        f"the daemon stopped while the run was in progress, {progress_text(run)}",
        f"the arm does not move by itself: start the run again; what was captured lies in {folder}",
    )
