"""Error and remedy for each status of a controller, in the table beside it."""

import json
from pathlib import Path

from drivers.errors import MoveFailed, MoveRefused, RequestRefused
from protocols.cb.codes import Status
from protocols.cb.messages import ErrorText, Refused

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
