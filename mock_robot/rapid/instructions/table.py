"""Implementations of system.rapid by name; each is called with its task, then its arguments in order."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.instructions import egm, flow, mathematics, motion, poses, rawbytes, settings, signals, sockets

_TABLES = (egm, flow, mathematics, motion, poses, rawbytes, settings, signals, sockets)

DOES: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name.casefold(): does for table in _TABLES for name, does in table.DOES.items()}
)

LEFT_OUT: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        name: frozenset(options.split())
        for name, options in {
            "movej": "conc v t",
            "movel": "conc v t",
            "moveabsj": "conc v t",
            "setdo": "sdelay sync",
            "ipers": "singlesafe",
            "itimer": "singlesafe",
            "socketcreate": "udp",
            "socketreceive": "data",
            "socketsend": "data",
            "open": "file read write append",
            "getsysdata": "taskref",
            "crobt": "taskref",
            "cjointt": "taskref",
            "calcjointt": "usecurwobjpos",
        }.items()
    }
)
"""Options of system.rapid that a program may not use here; they are not passed to the implementations."""
