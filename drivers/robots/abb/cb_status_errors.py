"""Error and remedy for each status of a controller, in the table beside it."""

import json
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import MoveFailed, MoveRefused, MoveStalled, RequestRefused
from drivers.robots.abb.cb_wire import STANDS_PER_MILLE
from protocols.cb.codes import Flag, Status
from protocols.cb.messages import ErrorText, Refused, Report

TABLE = Path(__file__).with_suffix(".json")
WHAT_TO_DO: dict[int, tuple[str, str]] = {
    Status[name]: (what, fix) for name, (what, fix) in json.loads(TABLE.read_text(encoding="utf-8")).items()
}


def _sentence(status: int) -> tuple[str, str]:
    unknown = (f"the controller answered with status {status}", "this release does not know it; read the event log")
    return WHAT_TO_DO.get(status, unknown)


def move_refusal(device: str, refused: Refused) -> MoveRefused:
    """The move did not start."""
    what, fix = _sentence(refused.status)
    return MoveRefused(device, f"the move was refused, {what}", fix, refused.name)


def move_failure(device: str, status: int, error: ErrorText | None = None) -> MoveFailed:
    """The move started and ended elsewhere than at its goal; `error`: ABB's own words about it."""
    what, fix = _sentence(status)
    if error is not None and error.number:
        what += f": {error.number} {error.title}" + (f" ({error.cause})" if error.cause else "")
    return MoveFailed(device, f"the move did not reach its goal, {what}", fix, Refused(status).name)


def request_refusal(device: str, asked: str, refused: Refused) -> RequestRefused:
    """A request other than a move was refused; `asked` completes "... was refused"."""
    what, fix = _sentence(refused.status)
    return RequestRefused(device, f"{asked} was refused, {what}", fix, refused.name)


FORGOTTEN_AFTER_S = 2.0
"""A controller that stands, reports no move and does not name this one for so long has forgotten it."""
STALLED_AFTER_S = 5.0
"""Less than a thousandth of the way in five seconds counts as a stall; no calibration moves that slowly."""


@dataclass
class MoveMonitor:
    """Decides from the controller's status reports when a move has ended. No clock, no I/O."""

    device: str
    seq: int
    _progress_per_mille: int = -1
    _advanced_at_s: float = 0.0

    def has_arrived(self, report: Report, now_s: float) -> bool:
        """Whether the arm stands at its goal. Raises MoveFailed if the move ended elsewhere, MoveStalled on a stall."""
        if report.finished_seq == self.seq:
            if report.finished_status != Status.OK:
                raise move_failure(self.device, report.finished_status)
            return True
        if report.progress_per_mille != self._progress_per_mille:
            self._progress_per_mille, self._advanced_at_s = report.progress_per_mille, now_s
        waited_s = now_s - self._advanced_at_s
        stands = bool(report.flags & Flag.IN_POSITION) and not report.flags & Flag.MOVING
        if stands and report.progress_per_mille >= STANDS_PER_MILLE and waited_s > FORGOTTEN_AFTER_S:
            what = f"the controller stands still and does not know move {self.seq} any more"
            raise MoveFailed(self.device, what, "read the pose before going on", Status.ABORTED.name)
        if waited_s > STALLED_AFTER_S:
            raise MoveStalled(self.device, *_why_it_waits(report))
        return False


def _why_it_waits(report: Report) -> tuple[str, str]:
    if report.progress_per_mille >= STANDS_PER_MILLE:
        return (
            "the arm does not come to rest at its goal",
            "look for vibration, and that the payload is set; run it again",
        )
    done = f"{report.progress_per_mille / 10:.0f} % of the way"
    return (
        f"the arm has stood still for {STALLED_AFTER_S:g} s after {done}, and was stopped",
        "turn the speed override up at the pendant, and see that nothing holds the program; then run it again",
    )
