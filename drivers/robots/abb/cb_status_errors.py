"""Error and remedy for each status of a controller, in one table."""

from drivers.errors import MoveFailed, MoveRefused, RequestRefused
from protocols.cb.codes import Status
from protocols.cb.messages import ErrorText, Refused

WHAT_TO_DO: dict[int, tuple[str, str]] = {
    Status.UNKNOWN_CMD: ("the controller does not know the command", "load the program modules of this release"),
    Status.BAD_LEN: ("the controller expects another message length", "load the program modules of this release"),
    Status.BAD_SUM: ("the request arrived damaged", "check the cable and its shield; on a serial line the baud rate"),
    Status.VERSION: ("no common version was agreed", "load the program modules of this release"),
    Status.BUSY: ("a move is already running", "wait for it to end, or stop it"),
    Status.NOT_ARMED: ("the arm is not armed", "arm it; it is disarmed after every reconnect"),
    Status.WRONG_MODE: (
        "the controller is not in automatic mode, or its motion program does not run",
        "switch to automatic, and start the program of the motion task",
    ),
    Status.MOTORS_OFF: ("the motors are off", "switch the motors on at the controller"),
    Status.UNREACHABLE: ("no joint angles reach the pose", "choose a pose nearer to the arm, or another configuration"),
    Status.OUTSIDE_BOX: (
        "outside the allowed space",
        "choose a pose inside it, or widen it in the controller's module",
    ),
    Status.ABORTED: ("the move was stopped before its goal", "see who stopped it; read the pose before going on"),
    Status.MOTION_ERROR: ("the controller reports a motion error", "read its event log, confirm it, then arm again"),
    Status.SPEED: ("the speed is not allowed", "ask for a slower move"),
    Status.DUPLICATE_SEQ_DIFFERENT_PAYLOAD: (
        "the number was used for another request",
        "another client may be on the line: leave only one",
    ),
    Status.ESTOP: ("the emergency stop is pressed", "make the cell safe, release it, confirm at the controller"),
    Status.NO_LOAD: (
        "the load on the flange is not set: cell_flange has the 1 gram of tool0",
        "set mass, centre and inertia of camera and bracket in cell_flange (CELL_shared.sys): run LoadIdentify",
    ),
    Status.INTERLOCK: (
        "an input that cell_interlock names is 0, or is not there",
        "see the cell's guard or gripper; the names stand in CELL_shared.sys",
    ),
    Status.BAD_FIELD: ("the request says something that means nothing there", "load the modules of this release"),
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
