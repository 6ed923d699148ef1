"""Instructions on the cabinet: mode, override, addresses."""

from collections.abc import Mapping
from types import MappingProxyType

from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.tasks import ProgramTask

MODES: Mapping[Mode, float] = MappingProxyType({Mode.AUTO: 1.0, Mode.MANR: 2.0, Mode.MANF: 3.0})
"""OP_AUTO, OP_MAN_PROG and OP_MAN_TEST of system.rapid."""


def op_mode(task: ProgramTask) -> float:
    return MODES[task.services.panel.mode]


def speed_override(task: ProgramTask, current_task: bool | None) -> float:
    return round(100 * float(task.services.panel.speed_override), 2)


def system_info(task: ProgramTask, lan_ip: bool | None) -> str:
    """Address of the controller; a virtual one answers VC."""
    if not lan_ip:
        raise RapidError("ERR_ARGVALERR", "GetSysInfo needs one of its switches")
    devices = task.services.devices
    return "VC" if devices.virtual else str(devices.host)


def runs_on_robot_controller(task: ProgramTask) -> bool:
    """FALSE on a virtual controller."""
    return not task.services.devices.virtual


DOES = MappingProxyType(
    {
        "OpMode": op_mode,
        "CSpeedOverride": speed_override,
        "GetSysInfo": system_info,
        "RobOS": runs_on_robot_controller,
    }
)
