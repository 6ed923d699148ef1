"""Instructions on the cabinet: mode, override, addresses."""

from collections.abc import Mapping
from types import MappingProxyType

from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.tasks import ProgramTask

MODES: Mapping[Mode, float] = MappingProxyType({Mode.AUTO: 1.0, Mode.MANR: 2.0, Mode.MANF: 3.0})
"""OP_AUTO, OP_MAN_PROG and OP_MAN_TEST of system.rapid."""

SYSTEM = ("mock-0001", "6.16.0202", "6.16.02.02", "mock", "mock", "en", "mock")
"""Serial number, version, its name, type of robot, controller's id, language and name of the system."""


def op_mode(task: ProgramTask) -> float:
    return MODES[task.services.panel.mode]


def speed_override(task: ProgramTask, current_task: bool | None) -> float:
    return round(100 * float(task.services.panel.speed_override), 2)


def system_info(task: ProgramTask, *switches: bool | None) -> str:
    """By its switch; the LAN address of a virtual controller is VC."""
    devices = task.services.devices
    known = (*SYSTEM[:5], "VC" if devices.virtual else str(devices.host), *SYSTEM[5:])
    asked = [text for text, switch in zip(known, switches, strict=True) if switch]
    if len(asked) != 1:
        raise RapidError("ERR_ARGVALERR", "GetSysInfo needs one of its switches")
    return asked[0]


def runs_on_robot_controller(task: ProgramTask) -> bool:
    """FALSE on a virtual controller."""
    return not task.services.devices.virtual


DOES = MappingProxyType(
    {"OpMode": op_mode, "CSpeedOverride": speed_override, "GetSysInfo": system_info, "RobOS": runs_on_robot_controller}
)
