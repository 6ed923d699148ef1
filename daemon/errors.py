"""Errors of the daemon. Each has a stable `code`, a sentence `what` and a `fix`."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from calibration.errors import ErrorWithFix
from calibration.sentences.sentence import Sentence, as_sentence

if TYPE_CHECKING:
    from calibration.kinematics.joint_path import OutsideBox


class DaemonError(ErrorWithFix, code="daemon-error"):
    """Base class. `what` is a sentence, `fix` says what to do, `code` is stable."""


class AnswerRefused(DaemonError, code="answer-refused"):
    """An answer of the first set-up that cannot be."""


class SetupConflict(DaemonError, code="setup-conflict"):
    """The cell is set up already, or its settings file is another than was read."""


class PrintRefused(DaemonError, code="print-refused"):
    """A target cannot be printed on this page."""


class RunInProgress(DaemonError, code="run-in-progress"):
    """A run is in progress; `holder` is its id."""

    def __init__(self, kind: str, run_id: str) -> None:
        self.holder = run_id
        what = Sentence("run-is-in-progress", kind=Sentence(f"kind-{kind}"), run=run_id)
        super().__init__(what, Sentence("wait-or-abort-run", run=run_id))


class CellBusy(DaemonError, code="cell-busy"):
    """The cell is held; `holder` says by what."""

    def __init__(self, holder: str) -> None:
        self.holder = holder
        super().__init__(Sentence("cell-is-held", holder=as_sentence(holder)), Sentence("wait-until-done"))


class CellNotReady(DaemonError, code="cell-not-ready"):
    """The robot or a device is not ready; `reasons` says why."""

    def __init__(self, reasons: tuple[str, ...], fix: Sentence | None = None) -> None:
        self.reasons = reasons
        what = Sentence("reasons", reasons=[*map(as_sentence, reasons)])
        super().__init__(what, fix or Sentence("put-right-at-cell"))


class InterlockOpen(CellNotReady, code="interlock-open"):
    """An interlock of the cell does not allow motion; `interlocks` names which."""

    def __init__(self, interlocks: tuple[str, ...], reasons: tuple[str, ...]) -> None:
        self.interlocks = interlocks
        super().__init__(reasons)


class AbortHeld(CellNotReady, code="abort-held"):
    """A PLC holds abort: one of `holders`, empty for one that set it while the run was being prepared."""

    def __init__(self, holders: tuple[str, ...]) -> None:
        held = tuple(Sentence("plc-holds-abort", holder=holder) for holder in holders)
        super().__init__(held or (Sentence("a-plc-set-abort"),), Sentence("clear-plc-abort"))


class NotStill(DaemonError, code="not-still"):
    """The arm moved during a capture, or did not come to rest."""


class PoseMismatch(DaemonError, code="elsewhere-than-sent"):
    """The arm reports another pose than the commanded one: units, quaternion order, tool or work object differ."""


class StaleCaptureError(DaemonError, code="same-again"):
    """A device repeated its last capture to the last bit, though the arm has moved."""


class PictureUnusable(DaemonError, code="picture-unusable"):
    """The camera's picture cannot be used."""


class NoPoses(DaemonError, code="no-poses"):
    """There are no poses, or fewer than asked for."""


class ArmUnknown(DaemonError, code="arm-unknown"):
    """The errors of the arm were asked for, and the settings do not name it, or it is of another kind."""

    def __init__(self, seven: str | None = None, *, upright: bool = True) -> None:
        """`seven`: name of the cell's arm with seven axes."""
        of_six = Sentence("arm-for-six-axes", arm=seven) if seven else Sentence("arm-is-not-named")
        fix = Sentence("leave-arm-out" if seven or not upright else "name-arm")
        super().__init__(of_six if upright else Sentence("arm-for-upright"), fix)


class NotInstalled(DaemonError, code="not-installed"):
    """What a request or the settings ask for is of an extension that this daemon does not have."""


class ToleranceLoosened(DaemonError, code="tolerance-loosened"):
    """A request states a larger tolerance than the settings, which forbid that."""

    def __init__(self, stated_mm: float, allowed_mm: float) -> None:
        self.stated_mm, self.allowed_mm = stated_mm, allowed_mm
        super().__init__(
            Sentence("tolerance-is-loosened", stated_mm=stated_mm, allowed_mm=allowed_mm),
            Sentence("state-smaller-tolerance"),
        )


class PoseRefused(DaemonError, code="pose-refused"):
    """A pose lies outside what the settings allow. `station` counts from 1; 0: a move that belongs to no station."""

    def __init__(self, station: int, what: str, fix: str) -> None:
        self.station, self.why = station, as_sentence(what)
        super().__init__(Sentence("at-pose", pose=station, what=self.why) if station else what, fix)


class PathRefused(PoseRefused):
    """The flange, or a point it carries, would leave the box on the way to a pose.

    `along`: the fraction of the move, 0 where the arm stands; `flange_mm`, `outside_mm`: where it would be furthest.
    """

    def __init__(self, station: int, found: "OutsideBox", box: Sentence) -> None:
        self.along, self.outside_mm = found.along, found.outside_mm
        self.flange_mm: tuple[float, ...] = tuple(float(x) for x in found.flange_mm)
        x_mm, y_mm, z_mm = self.flange_mm
        where = {"x_mm": x_mm, "y_mm": y_mm, "z_mm": z_mm, "outside_mm": self.outside_mm, "box": box}
        who = "carried" if found.carried else "flange"
        if self.along == 0:
            super().__init__(station, Sentence(f"{who}-starts-outside", **where), Sentence("jog-into-box"))
        else:
            what = Sentence(f"{who}-leaves-box", percent=100 * self.along, **where)
            super().__init__(station, what, Sentence("put-pose-between"))


Noun = Literal["run", "calibration", "scan"]


class NotFound(DaemonError, code="not-found"):
    """No such run, calibration, scan, frame, view or page."""

    @classmethod
    def noun(cls, noun: Noun, given_id: str) -> "NotFound":
        """One with no row of that id."""
        return cls(Sentence(f"no-such-{noun}", id=given_id), Sentence("see-list", list=f"{noun}s"))

    @classmethod
    def file(cls, path: Path) -> "NotFound":
        """One whose file is not there."""
        return cls(Sentence("no-such-file", name=path.name, folder=path.parent.name), Sentence("look-what-is-stored"))


class CursorUnknown(DaemonError, code="cursor-unknown"):
    """The cursor of a page does not exist."""

    def __init__(self, what: str, before: str) -> None:
        super().__init__(Sentence("no-such-cursor", before=before[:64], list=what), Sentence("follow-next"))


class AppliedMeanwhile(DaemonError, code="applied-meanwhile"):
    """Something else is active than the request expects."""

    def __init__(self, now: int) -> None:
        self.now = now
        what = Sentence("another-is-active") if now else Sentence("none-is-active-yet")
        super().__init__(what, Sentence("look-at-current"))


class BackupUnusable(DaemonError, code="backup-unusable"):
    """A backup cannot be restored."""


class RunOver(DaemonError, code="run-over"):
    """The run has ended."""


class StopUnconfirmed(DaemonError, code="stop-unconfirmed"):
    """The run is ended, but the controller has not confirmed that the arm is stopped and disarmed."""

    def __init__(self, run_id: str, warning: Sentence, *, stopped: bool, disarmed: bool) -> None:
        self.holder, self.stopped, self.disarmed = run_id, stopped, disarmed
        what = Sentence("run-ended-unconfirmed", run=run_id, warning=warning)
        super().__init__(what, Sentence("press-emergency-stop"))


class NotWaiting(DaemonError, code="not-waiting"):
    """The run moves the arm itself and takes no requests."""

    def __init__(self, run_id: str) -> None:
        super().__init__(
            Sentence("run-drives-itself", run=run_id), Sentence("follow-run", at="{id}", body='{"manual": true}')
        )


class NotHeld(DaemonError, code="not-held"):
    """No motion waits for this button, or it was let go: it is not taken up again."""

    def __init__(self) -> None:
        super().__init__(Sentence("no-motion-for-button"), Sentence("hold-again"))


class SamePose(DaemonError, code="same-pose"):
    """The arm stands where a view was taken already."""


class TooFewViews(DaemonError, code="too-few-views"):
    """A manual run cannot be finished yet."""


class OperatorTimeout(DaemonError, code="operator-gone"):
    """A manual run received no request in time."""


class RunStalled(DaemonError, code="run-stalled"):
    """A step of a run exceeded its time limit."""


class NoCalibration(DaemonError, code="no-calibration"):
    """No calibration is active, of [camera] or of another camera by name."""

    def __init__(self, camera: str = "camera") -> None:
        main = camera == "camera"
        what = Sentence("no-active-calibration") if main else Sentence("no-active-calibration-of", camera=camera)
        super().__init__(what, Sentence("calibrate-then-apply", calibration="{id}"))


class CalibrationUnusable(DaemonError, code="calibration-unusable"):
    """A calibration must not, or cannot, be applied."""


class TargetNotSeen(DaemonError, code="target-not-seen"):
    """Too few stations saw the target."""


class NoScanner(DaemonError, code="no-scanner"):
    """The settings name no scanner."""

    def __init__(self) -> None:
        super().__init__(Sentence("no-scanner-named"), Sentence("add-scanner"))


class ScanEmpty(DaemonError, code="scan-empty"):
    """The scan has no views."""


class WorkersBusy(DaemonError, code="workers-busy"):
    """As many merges and registrations wait as may: one is computed at a time."""

    def __init__(self, waiting: int) -> None:
        super().__init__(Sentence("workers-full", waiting=waiting), Sentence("ask-again-soon"))


class StorageError(DaemonError, code="storage-error"):
    """The store could not be read or written; nothing stored before is lost."""


class StorageFull(StorageError, code="storage-full"):
    """The disk is full."""


class StorageInconsistent(StorageError, code="storage-inconsistent"):
    """The store is damaged, behind its audit anchor, moved or replaced: nothing is written, and no run is started."""


class StorageTooNew(StorageError, code="storage-too-new"):
    """The store was written by a newer handeyed."""


class StorageInUse(StorageError, code="storage-in-use"):
    """Another daemon uses the store."""


class PortTaken(DaemonError, code="port-taken"):
    """The daemon cannot listen where the settings say."""


class Stopping(DaemonError, code="stopping"):
    """The daemon is shutting down, or is held for an update."""

    def __init__(self, what: str | None = None) -> None:
        super().__init__(what or Sentence("daemon-is-stopping"), Sentence("ask-when-started"))
