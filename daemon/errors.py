"""Errors of the daemon's room. Each carries a stable `code` and a `fix`: what to do.

DaemonError
├── RunInProgress         one run at a time; `holder` says which
├── CellBusy              somebody else holds the cell; `holder` says who
├── CellNotReady          the robot or a device would not do it now; `reasons`
│   └── InterlockOpen     an interlock of the cell does not allow motion; `interlocks`
├── NotStill              the arm moved while it was looked at, or never came to rest
├── ElsewhereThanSent     the arm says it stands where nobody sent it
├── SameAgain             a device sent what it had sent before, from another pose
├── PictureUnusable       the camera's picture cannot be used
├── NoPoses               nothing says where to look from
├── PoseRefused           a pose lies outside what the settings allow; `station`
├── NotFound              no such run, calibration, scan, frame, view or page
├── RunOver               the run has ended; there is nothing to abort
├── NotWaiting            the run drives the arm itself, it waits for no operator
├── SamePose              the arm stands where a view was taken already
├── TooFewViews           a manual run cannot be finished yet
├── OperatorGone          a manual run waited too long for its operator
├── RunStalled            a run did not get any further, though nothing said why
├── CursorUnknown         a page before something that is not there
├── AppliedMeanwhile      something else is in force than the request expects
├── BackupUnusable        a backup that cannot be restored, or not there
├── NoCalibration         nothing is applied yet
├── CalibrationUnusable   a calibration that must not, or cannot, be applied
├── TargetNotSeen         too few stations saw the target
├── NoScanner             the settings name no scanner
├── ScanEmpty             a scan without views has no cloud
├── StorageError          the store could not be read or written; nothing stored before is lost
│   ├── StorageFull       the disk is full
│   ├── StorageInUse      another daemon keeps its store there
│   └── StorageTooNew     written by a newer handeyed
├── PortTaken             the daemon cannot listen where the settings say
├── (access/errors.py)    keys, roles, certificates
├── (api/http_errors.py)  what only an HTTP request can do wrong
└── Stopping              the daemon is shutting down
"""

from typing import ClassVar


class DaemonError(Exception):
    """Root. `what` is a sentence, `fix` says what to do, `code` is stable."""

    code: ClassVar[str] = "daemon-error"

    def __init__(self, what: str, fix: str) -> None:
        self.what, self.fix = what, fix
        super().__init__(f"{what}: {fix}")


class RunInProgress(DaemonError):
    """One run at a time."""

    code = "run-in-progress"

    def __init__(self, kind: str, run_id: str) -> None:
        self.holder = run_id
        super().__init__(
            f"{kind} run {run_id} is in progress", f"wait for it to end, or stop it with POST /runs/{run_id}/abort"
        )


class CellBusy(DaemonError):
    """Somebody else holds the cell."""

    code = "cell-busy"

    def __init__(self, holder: str) -> None:
        self.holder = holder
        super().__init__(f"the cell is held by {holder}", "wait until it is done and ask again")


class CellNotReady(DaemonError):
    """The robot or a device would not do it now."""

    code = "cell-not-ready"

    def __init__(self, reasons: tuple[str, ...]) -> None:
        self.reasons = reasons
        super().__init__("; ".join(reasons), "put this right at the cell, see GET /ready, and ask again")


class InterlockOpen(CellNotReady):
    """An interlock of the cell does not allow motion; `interlocks` names which."""

    code = "interlock-open"

    def __init__(self, interlocks: tuple[str, ...], reasons: tuple[str, ...]) -> None:
        self.interlocks = interlocks
        super().__init__(reasons)


class NotStill(DaemonError):
    """The arm moved while it was looked at, or never came to rest."""

    code = "not-still"


class PoseMismatch(DaemonError):
    """The arm says it stands where nobody sent it: units, quaternion order, tool or work object are others."""

    code = "elsewhere-than-sent"


class StaleCaptureError(DaemonError):
    """A device sent what it had sent before, to the last bit, though the arm stands elsewhere."""

    code = "same-again"


class PictureUnusable(DaemonError):
    """The camera's picture cannot be used."""

    code = "picture-unusable"


class NoPoses(DaemonError):
    """Nothing says where to look from."""

    code = "no-poses"


class PoseRefused(DaemonError):
    """A pose lies outside what the settings allow. `station` counts from 1."""

    code = "pose-refused"

    def __init__(self, station: int, what: str, fix: str) -> None:
        self.station = station
        super().__init__(f"station {station}: {what}", fix)


class NotFound(DaemonError):
    """No such thing."""

    code = "not-found"


class CursorUnknown(DaemonError):
    """A page before something that is not there."""

    code = "cursor-unknown"

    def __init__(self, what: str, before: str) -> None:
        super().__init__(f"there is no {before[:64]!r} among the {what}", "follow `next` of the page before")


class AppliedMeanwhile(DaemonError):
    """Something else is in force than the request expects."""

    code = "applied-meanwhile"

    def __init__(self, now: int) -> None:
        self.now = now
        super().__init__(
            "another calibration is in force than If-Match names" if now else "no calibration is in force yet",
            "look at GET /calibrations/current and send its ETag, if this one is still to be applied",
        )


class BackupUnusable(DaemonError):
    """A backup that cannot be restored, or not there."""

    code = "backup-unusable"


class RunOver(DaemonError):
    """The run has ended."""

    code = "run-over"


class NotWaiting(DaemonError):
    """The run drives the arm itself."""

    code = "not-waiting"

    def __init__(self, run_id: str) -> None:
        super().__init__(
            f"run {run_id} drives the arm itself and waits for nobody",
            'follow it with GET /runs/{id}; a run that waits is started with POST /calibrate {"manual": true}',
        )


class SamePose(DaemonError):
    """The arm stands where a view was taken already."""

    code = "same-pose"


class TooFewViews(DaemonError):
    """A manual run cannot be finished yet."""

    code = "too-few-views"


class OperatorTimeout(DaemonError):
    """A manual run waited too long for its operator."""

    code = "operator-gone"


class RunStalled(DaemonError):
    """A run did not get any further: something that always ends, or has a limit, did not."""

    code = "run-stalled"


class NoCalibration(DaemonError):
    """Nothing is applied yet."""

    code = "no-calibration"

    def __init__(self) -> None:
        super().__init__(
            "no calibration is applied", "calibrate (POST /calibrate), then apply it (POST /calibrations/{id}/apply)"
        )


class CalibrationUnusable(DaemonError):
    """A calibration that must not, or cannot, be applied."""

    code = "calibration-unusable"


class TargetNotSeen(DaemonError):
    """Too few stations saw the target."""

    code = "target-not-seen"


class NoScanner(DaemonError):
    """The settings name no scanner."""

    code = "no-scanner"

    def __init__(self) -> None:
        super().__init__("the settings name no scanner", "add [scanner] with its address, or send the cloud yourself")


class ScanEmpty(DaemonError):
    """A scan without views has no cloud."""

    code = "scan-empty"


class StorageError(DaemonError):
    """The store could not be read or written; nothing stored before is lost."""

    code = "storage-error"


class StorageFull(StorageError):
    """The disk is full."""

    code = "storage-full"


class StorageTooNew(StorageError):
    """Written by a newer handeyed."""

    code = "storage-too-new"


class StorageInUse(StorageError):
    """Another daemon keeps its store there."""

    code = "storage-in-use"


class PortTaken(DaemonError):
    """The daemon cannot listen where the settings say."""

    code = "port-taken"


class Stopping(DaemonError):
    """The daemon is shutting down."""

    code = "stopping"

    def __init__(self) -> None:
        super().__init__("the daemon is stopping", "ask again when it has started")
