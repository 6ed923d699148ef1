"""Every named fault of the mock cell: what the operator sees, within which time, and where it leaves the arm.

`python -m tests.stories.fault_rows` prints docs/faults.md; the tests that the page names try every row.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from mock_robot.faults.tables import DEVICE_FAULTS, FAULTS
from tests.stories.camera_fault_rows import camera_page

SUMMARIES: Mapping[str, str] = {
    fault.name: fault.summary
    for fault in (*FAULTS.values(), *DEVICE_FAULTS.values())
    if fault.area not in ("rws", "egm")
}
"""All that strike a run which moves the arm."""
SERVICES: Mapping[str, str] = {fault.name: fault.summary for fault in FAULTS.values() if fault.area in ("rws", "egm")}
"""Those of Robot Web Services and EGM, over which nothing moves: they strike an operator who takes pictures by hand."""


@dataclass(frozen=True)
class Row:
    """`code` None: the job goes on to its end. `tells` and `fix` are regular expressions of what the operator reads.

    `within_s` is from the moment the fault strikes, on a PC that has time. `finding`: what the
    verdict says of it. Whatever the row says, the arm stands afterwards, disarmed, and
    moves on a new start only.
    """

    fault: str
    code: str | None
    tells: str
    fix: str = ""
    within_s: float | None = None
    job: Literal["calibrate", "scan"] = "calibrate"
    accepted: bool = True
    serial: bool = False
    finding: str = ""


LOST = "link to the controller lost"
CELL_PROGRAM = "check the cable and that the cell program runs"
PROGRAM = "look at the controller's program"
SOON_S, SILENT_S, STALLED_S, DEVICE_S = 1.0, 3.0, 6.0, 6.0
"""A camera has 5 s for a picture; the scanner of this plant has as much for a cloud, unless the fault is lateness."""


def _fails(fault: str, code: str, tells: str, fix: str, within_s: float = SOON_S, **changes: Any) -> Row:
    return Row(fault, code, tells, fix, within_s, **changes)


def _lost(fault: str, within_s: float = SOON_S) -> Row:
    return _fails(fault, "link-lost", LOST, CELL_PROGRAM, within_s)


def _damaged(fault: str) -> Row:
    return _fails(fault, "garbled-answer", "what came is not the CB link", "check the cable and its shield")


def _goes_on(fault: str, tells: str, **changes: Any) -> Row:
    return Row(fault, None, tells, **changes)


def _left_out(fault: str, finding: str) -> Row:
    return _goes_on(fault, "the picture is left out, and the verdict says so", finding=finding)


ROWS = (
    _goes_on("link-delay", "nothing: it takes longer"),
    _lost("link-stall", SILENT_S),
    _goes_on("link-split", "nothing"),
    _lost("link-drop-mid-frame"),
    _lost("link-close"),
    _lost("link-reset"),
    _lost("link-half-open", SILENT_S),
    _goes_on("link-reply-lost", "nothing: the request is repeated under its number and executed once"),
    _goes_on("link-deaf-once", "nothing: the request is repeated"),
    _damaged("link-bit-flip"),
    _lost("link-request-bit-flip"),
    _goes_on("link-duplicate", "nothing: the second reply is dropped"),
    _goes_on("link-request-duplicate", "nothing: a repeated request is answered from memory"),
    _damaged("link-garbage"),
    _damaged("link-only-garbage"),
    _lost("link-restart"),
    _goes_on("serial-noise", "nothing: it is skipped", serial=True),
    _goes_on("serial-half-frame", "nothing: the request is repeated", serial=True),
    _goes_on("serial-doubled-byte", "nothing: the request is repeated", serial=True),
    _goes_on("serial-break", "nothing: the request is repeated", serial=True),
    _goes_on("serial-magic-in-noise", "nothing: the request is repeated", serial=True),
    _fails("robot-emergency-stop", "move-failed", "the emergency stop is pressed", "make the cell safe, release it"),
    _fails("robot-motors-off", "move-failed", "the motors are off", "switch the motors on"),
    _fails("robot-manual-mode", "move-failed", "not in automatic mode", "switch to automatic"),
    _fails("robot-program-stopped", "move-failed", "its motion program does not run", "start the program"),
    _fails("robot-not-settled", "move-failed", "does not come to rest", "look for vibration", STALLED_S),
    _fails("robot-override-zero", "move-failed", "stood still for 5 s", "turn the speed override up", STALLED_S),
    _fails("robot-nan-pose", "garbled-answer", "a number that is none", PROGRAM),
    _fails("robot-quaternion-not-unit", "garbled-answer", "norm 0.9 is not 1", PROGRAM),
    _fails("robot-metres", "elsewhere-than-sent", "says it stands at", "metres where millimetres belong"),
    _fails("robot-quaternion-xyzw", "elsewhere-than-sent", "says it stands at", "scalar part last"),
    _goes_on("robot-wrong-configuration", "nothing: each move names its own configuration"),
    _goes_on("robot-clock-jump", "nothing: the controller's clock is not relied on"),
    _fails("camera-late", "device-timeout", "no answer in 5 s", "check that the device is on", DEVICE_S),
    _goes_on("camera-away", "nothing: the request is repeated"),
    _fails("camera-repeated", "same-again", "the same picture again", "captures anew for each request"),
    _fails("camera-stale", "device-timeout", "older than asked for", "goes on taking pictures", DEVICE_S),
    _left_out("camera-black", "the image is black"),
    _left_out("camera-saturated", "the image is"),
    _goes_on(
        "camera-torn",
        "the picture or its torn corners are left out, and the verdict says so",
        finding="picture 2|corners lie too far",
    ),
    _fails("camera-wrong-size", "garbled-answer", "expected 960×600", "set the camera to the size"),
    _fails("camera-half-file", "garbled-answer", "not a whole picture", "whole PNG or JPEG"),
    _fails("camera-empty-file", "garbled-answer", "the answer is empty", "check the device and the URL"),
    _left_out("camera-target-hidden", "picture 2"),
    _goes_on("scanner-late", "nothing, within `[scanner] limit_s`", job="scan"),
    _goes_on("scanner-away", "nothing: the request is repeated", job="scan"),
    _fails("scanner-repeated", "same-again", "the same cloud again", "captures anew for each request", job="scan"),
    _fails("scanner-stale", "device-timeout", "older than asked for", "goes on", DEVICE_S, job="scan"),
    _fails("scanner-empty", "nothing-measured", "the cloud has no points", "within the scanner's range", job="scan"),
    _goes_on("scanner-nan", "nothing: points that are not finite are left out", job="scan"),
    _fails("scanner-half-file", "garbled-answer", "not a whole cloud file", "whole PLY or PCD", job="scan"),
)


@dataclass(frozen=True)
class ViewRow:
    """What the operator reads who takes a picture by hand; `code` None: the picture is taken all the same."""

    fault: str
    code: str | None
    tells: str
    fix: str = ""
    within_s: float = SOON_S


MUTE = "check that the program runs EGMStreamStart"
VIEW_ROWS = (
    ViewRow("rws-401", "request-refused", "user or password is refused", "password_file"),
    ViewRow("rws-406", "request-refused", "no media type of ours will do", "set version= in the address"),
    ViewRow("rws-503", "device-unreachable", "it answers 503, its 70 sessions are taken", "close other clients"),
    ViewRow(
        "rws-410", None, "nothing: pictures need no mastership; an upload of modules is refused, since there is none"
    ),
    ViewRow("rws-slow", None, "nothing: it takes longer", within_s=12.0),
    ViewRow("rws-garbage", "garbled-answer", "no answer of RWS 2.0", "check that the address is a controller's"),
    ViewRow("rws-sessions-exhausted", "device-unreachable", "its 70 sessions are taken", "close other clients"),
    ViewRow(
        "rws-mastership-held",
        None,
        "nothing: pictures need no mastership; an upload of modules is refused with its holder",
    ),
    ViewRow("rws-subscription-gone", None, "nothing: the state is polled, and pictures need no events"),
    ViewRow("egm-silent", "device-timeout", "samples came within 0.25 s", MUTE),
    ViewRow("egm-loss", None, "nothing: four packets of five are enough"),
    ViewRow("egm-garbage", "device-timeout", "samples came within 0.25 s", MUTE),
    ViewRow("egm-vibration", "not-still", "the flange still vibrates by 0.", "look for what shakes it"),
    ViewRow("rws-other-tool", None, "nothing: poses are asked for in tool0 and wobj0 by name"),
)


HEADING = """# Faults, and what handeyed reports

Each fault can be set on the mock cell when it starts (`handeyed mock run --fault NAME`) and while it runs
(`POST /faults/NAME` on its control port; `DELETE` clears it). In this table it occurs
between the first and the last station of a run. In every case the arm then stands still, disarmed, and moves only
on a new, explicit start; as long as the controller has not confirmed that, `GET /ready` says so and no run starts.
Captured data stay stored. A calibration that is not accepted is not activated.

`pytest tests/stories/test_faults.py` tries every row; `python -m tests.stories.fault_rows` writes this page.

| fault | what happens | the run | what the operator reads | what to do | reported within |
|---|---|---|---|---|---|
"""


VIEW_HEADING = """
## Robot Web Services and EGM

Nothing is commanded over them: in every case the arm stands where the operator jogged it. In this table the fault
occurs when a view is requested by hand; the run keeps waiting, and after the fault is cleared the next view is taken.
`pytest tests/stories/test_faults_of_services.py` tries every row over RWS 2.0 with EGM beside it.

| fault | what happens | the view | what the operator reads | what to do | reported within |
|---|---|---|---|---|---|
"""


def page() -> str:
    """docs/faults.md."""
    rows = "".join(f"{_line(row)}\n" for row in ROWS)
    services = "".join(f"{_view_line(row)}\n" for row in VIEW_ROWS)
    return HEADING + rows + VIEW_HEADING + services + camera_page()


def _view_line(row: ViewRow) -> str:
    ends = f"refused: `{row.code}`" if row.code else "taken"
    within = f"{row.within_s:g} s" if row.code else ""
    return f"| `{row.fault}` | {SERVICES[row.fault]} | {ends} | {row.tells} | {row.fix} | {within} |"


def _line(row: Row) -> str:
    ends = f"fails: `{row.code}`" if row.code else "goes on" if row.accepted else "ends, not accepted"
    within = f"{row.within_s:g} s" if row.within_s else ""
    return f"| `{row.fault}` | {SUMMARIES[row.fault]} | {ends} | {row.tells} | {row.fix} | {within} |"


if __name__ == "__main__":
    print(page(), end="")
