"""What a person is asked to do at the controller, and what the person answers."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol


class Answer(Enum):
    DONE = "done"
    NO = "no"
    SKIP = "skip"


@dataclass(frozen=True)
class Step:
    """One instruction. `code` is stable; `now`: while the arm moves, so that nobody waits for an answer.

    `consent`: a question that may be answered no, which leaves the row out.
    """

    code: str
    text: str
    now: bool = False
    consent: bool = False


class Person(Protocol):
    """Does what a program cannot do."""

    async def do(self, step: Step) -> Answer:
        """Show the instruction; returns at once when it is for now, otherwise when it is done, denied or skipped."""
        ...


KEY, KEYLESS = "turn the key to", "at the pendant (QuickSet, operating mode) choose"
"""How the operating mode is changed: {choose} of a step."""

ROOM = Step("room", "the arm will move up to {travel} mm along its flange axis, and turn up to {turn}°: is there room?")
PENDANT = Step("pendant", "pendant, Jogging, tool0 and wobj0: does it show {pose}?")
ESTOP = Step("estop", "NOW: press the emergency stop", now=True)
ESTOP_RELEASE = Step("estop-release", "release it, motors on, start the program WITHOUT PP to main")
TO_MANUAL = Step("to-manual", "NOW: {choose} manual", now=True)
TO_AUTO = Step("to-auto", "{choose} AUTO, confirm, motors on, start the program")
ENABLE = Step("enable", "{choose} manual reduced speed, hold the enabling device, start the program")
DISABLE = Step("disable", "NOW: release the enabling device", now=True)
PROGRAM_STOP = Step("program-stop", "NOW: press Stop at the pendant", now=True)
PROGRAM_START = Step("program-start", "press Start, WITHOUT PP to main")
HOLD_PLUG = Step("hold-plug", "next the network plug between this PC and the controller is pulled in a move: hold it")
PULL = Step("pull", "NOW: pull the network plug between this PC and the controller", now=True)
PLUG = Step("plug", "plug it in again")
CUT_CONSENT = Step("cut-consent", "the next row switches the mains off while the arm moves: may it?", consent=True)
POWER_CUT = Step("power-cut", "NOW: switch the controller's mains off", now=True)
POWER_ON = Step("power-on", "switch it on; when it is up: motors on, start the program WITHOUT PP to main")
POWER_ON_MAIN = Step("power-on-main", "switch it on; when it is up: PP to main, motors on, start the program")
RESTART = Step("restart", "restart the controller (warm start), then motors on, PP to main, start the program")
EVENT = Step("event", "{choose} manual and back to AUTO, confirm, motors on, start the program")
