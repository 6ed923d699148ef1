"""Commands, verdicts, bits and states of the register map, and the numbers of errors."""

import json
from enum import IntEnum, IntFlag
from pathlib import Path

MAP_VERSION = 1
"""Incremented when a register changes its address or meaning; added registers leave it unchanged."""


class PlcCommand(IntEnum):
    """Commands a PLC can trigger."""

    NONE = 0
    CALIBRATE = 1
    VERIFY = 2
    REGISTER = 3


class PlcVerdict(IntEnum):
    """How a command ended. Only ACCEPTED is a success."""

    NONE = 0
    ACCEPTED = 1
    REJECTED = 2
    FAILED = 3
    ABORTED = 4


class ControlBit(IntFlag):
    """Bits of the control register. All act on their rising edge; RESULTS_ACK and ABORT are read as levels, too."""

    TRIGGER_CALIBRATE = 1
    TRIGGER_VERIFY = 2
    TRIGGER_REGISTER = 4
    RESULTS_ACK = 8
    ABORT = 16
    CLEAR_ERROR = 32


TRIGGERS: dict[ControlBit, PlcCommand] = {
    ControlBit.TRIGGER_CALIBRATE: PlcCommand.CALIBRATE,
    ControlBit.TRIGGER_VERIFY: PlcCommand.VERIFY,
    ControlBit.TRIGGER_REGISTER: PlcCommand.REGISTER,
}

TRIGGER_BITS = ControlBit.TRIGGER_CALIBRATE | ControlBit.TRIGGER_VERIFY | ControlBit.TRIGGER_REGISTER


class StatusBit(IntFlag):
    """Bits of the status register, at In-Sight's positions where In-Sight has the same bit."""

    READY = 1
    TRIGGER_ACK = 2
    CALIBRATION_IN_FORCE = 4
    MISSED_TRIGGER = 8
    DRIFT_ALARM = 16
    MOTION_ALLOWED = 32
    PLC_SILENT = 64
    ONLINE = 128
    BUSY = 256
    COMPLETED = 512
    BUFFER_OVERRUN = 1024
    RESULTS_VALID = 2048
    STOP_UNCONFIRMED = 4096
    ERROR = 32768


class ContentsBit(IntFlag):
    """Which values of a result block are valid; all others are 0."""

    X = 1
    UNCERTAINTY = 2
    DEVIATION = 4
    WORST_POINT = 8
    TOLERANCE = 16
    TOLERANCE_STATED = 32
    EXPECTED = 64
    BEFORE = 128
    UNEXPECTED = 256
    IN_FORCE = 512


class DriftState(IntEnum):
    """State of the control chart of the verifications."""

    OFF = 0
    LEARNING = 1
    STEADY = 2
    DRIFTING = 3


NO_ERROR = 0
UNKNOWN = 999
"""An error without a number: the log and the REST interface have its message."""

ERROR_CODES: dict[str, tuple[int, str]] = {
    code: (number, meaning)
    for code, (number, meaning) in json.loads(Path(__file__).with_name("error_codes.json").read_text("utf-8")).items()
}
"""Number and meaning of each stable code, from the sheet beside this file. A number is never reused for another error.

Tens: 0 the PLC itself, 1 and 2 refused now, 3 and 4 robot and devices, 5 what was seen, 6 the computer, 9 a defect.
"""


def number_of(code: str) -> int:
    """The number of an error's stable code."""
    return ERROR_CODES[code][0] if code in ERROR_CODES else UNKNOWN
