"""What a program sees of its cabinet: signals, mode, override, addresses."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.cabinet.panel import Mode
from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.tasks import Task

MODES: Mapping[Mode, float] = MappingProxyType({Mode.AUTO: 1.0, Mode.MANR: 2.0, Mode.MANF: 3.0})
"""OP_AUTO, OP_MAN_PROG and OP_MAN_TEST of system.rapid."""


def d_output(task: Task, signal: Callable[[], bool]) -> float:
    """A signal is what a system output tells."""
    return float(signal())


def op_mode(task: Task) -> float:
    return MODES[task.services.panel.mode]


def speed_override(task: Task, current_task: bool | None) -> float:
    return round(100 * float(task.services.panel.speed_override), 2)


def system_info(task: Task, *asked: Any) -> str:
    if not asked[3]:
        raise RapidError("ERR_ARGVALERR", "the mock knows \\LanIp alone")
    return str(task.services.devices.host)


DOES = MappingProxyType(
    {"DOutput": d_output, "OpMode": op_mode, "CSpeedOverride": speed_override, "GetSysInfo": system_info}
)
