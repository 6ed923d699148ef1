"""Commands, verdicts, bits and states of the register map, as numbers with names."""

from enum import IntEnum, IntFlag

MAP_VERSION = 1
"""Counts up when a register changes its place or meaning; one that is only added leaves it as it is."""


class Command(IntEnum):
    """What a PLC can start."""

    NONE = 0
    CALIBRATE = 1
    VERIFY = 2
    REGISTER = 3


class Verdict(IntEnum):
    """How a command ended. ACCEPTED is the only good one."""

    NONE = 0
    ACCEPTED = 1
    REJECTED = 2
    FAILED = 3
    ABORTED = 4


class Control(IntFlag):
    """The control register. Everything acts on its rising edge; results_ack is a level, too."""

    TRIGGER_CALIBRATE = 1
    TRIGGER_VERIFY = 2
    TRIGGER_REGISTER = 4
    RESULTS_ACK = 8
    ABORT = 16
    CLEAR_ERROR = 32


TRIGGERS: dict[Control, Command] = {
    Control.TRIGGER_CALIBRATE: Command.CALIBRATE,
    Control.TRIGGER_VERIFY: Command.VERIFY,
    Control.TRIGGER_REGISTER: Command.REGISTER,
}

TRIGGER_BITS = Control.TRIGGER_CALIBRATE | Control.TRIGGER_VERIFY | Control.TRIGGER_REGISTER


class Status(IntFlag):
    """The status register; the positions are In-Sight's where it has the same bit."""

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
    ERROR = 32768


class Contents(IntFlag):
    """Which numbers of a result block mean something; all others are 0."""

    X = 1
    UNCERTAINTY = 2
    DEVIATION = 4


class DriftState(IntEnum):
    """Where the control chart of the verifications stands."""

    OFF = 0
    LEARNING = 1
    STEADY = 2
    DRIFTING = 3
