"""Implementations of system.rapid by name; each is called with its task, then its arguments in order."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.instructions import (
    cabinet,
    clocks,
    common,
    egm,
    error_events,
    flow,
    interrupts,
    mathematics,
    motion,
    poses,
    rawbytes,
    serial,
    settings,
    signals,
    sockets,
)

_TABLES = (
    cabinet,
    clocks,
    common,
    egm,
    error_events,
    flow,
    interrupts,
    mathematics,
    motion,
    poses,
    rawbytes,
    serial,
    settings,
    signals,
    sockets,
)

DOES: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name.casefold(): does for table in _TABLES for name, does in table.DOES.items()}
)

_MOVE = "conc id v t z inpos"
LEFT_OUT: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        name: frozenset(options.split())
        for name, options in {
            "movej": _MOVE,
            "movel": _MOVE,
            "moveabsj": f"{_MOVE} noeoffs",
            "waituntil": "visualize header message wrap icon image visualizetime uiactivesignal",
            "ipers": "singlesafe",
            "itimer": "singlesafe",
            "clkread": "highres",
            "socketcreate": "udp",
            "socketreceive": "data",
            "socketsend": "data",
            "open": "file",
            "getsysinfo": "serialno swversion swversionname robottype ctrlid ctrllang systemname",
            "getsysdata": "taskref",
            "setdo": "sdelay sync",
            "pulsedo": "high plength",
            "waitdi": "maxtime timeflag",
            "waitdo": "maxtime timeflag",
            "stop": "noregain allmovetasks",
            "crobt": "taskref",
            "cjointt": "taskref",
            "calcjointt": "usecurwobjpos",
        }.items()
    }
)
"""Options of system.rapid that a program may not use here; they are not passed to the implementations."""
