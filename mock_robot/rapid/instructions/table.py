"""Implementations of system.rapid by name; each is called with its task, then its arguments in order."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.instructions import (
    cabinet,
    clocks,
    flow,
    interrupts,
    mathematics,
    motion,
    poses,
    rawbytes,
    serial,
    sockets,
)

_TABLES = (cabinet, clocks, flow, interrupts, mathematics, motion, poses, rawbytes, serial, sockets)

DOES: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name.casefold(): does for table in _TABLES for name, does in table.DOES.items()}
)
