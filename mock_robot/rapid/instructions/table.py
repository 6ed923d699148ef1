"""Implementations of system.rapid by name; each is called with its task, then its arguments in order."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.instructions import (
    cabinet,
    clocks,
    common,
    displacements,
    egm,
    error_events,
    flow,
    interrupts,
    mathematics,
    message_queues,
    motion,
    names,
    pendant,
    poses,
    rawbytes,
    serial,
    settings,
    signals,
    sockets,
    synchronization,
    texts,
    triggers,
    world_zones,
)

_TABLES = (
    cabinet,
    clocks,
    common,
    displacements,
    egm,
    error_events,
    flow,
    interrupts,
    mathematics,
    message_queues,
    motion,
    names,
    pendant,
    poses,
    rawbytes,
    serial,
    settings,
    signals,
    sockets,
    synchronization,
    texts,
    triggers,
    world_zones,
)

DOES: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name.casefold(): does for table in _TABLES for name, does in table.DOES.items()}
)

LEFT_OUT: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        name: frozenset(options.split())
        for name, options in {
            "triggj": "conc",
            "triggl": "conc",
            "triggc": "conc",
            "triggequip": "next procid inhib",
            "waitgi": "dvalueattimeout",
            "waitgo": "dvalueattimeout",
            "movejdo": "tload",
            "moveldo": "tload",
            "movejsync": "tload",
            "movelsync": "tload",
            "storepath": "keepsync",
            "getdataval": "block taskref taskname",
            "setdataval": "block taskref taskname",
            "ipers": "singlesafe",
            "itimer": "singlesafe",
            "isignaldi": "singlesafe",
            "isignaldo": "singlesafe",
            "isignalgi": "singlesafe",
            "isignalgo": "singlesafe",
            "socketcreate": "udp",
            "socketreceive": "data",
            "socketsend": "data",
            "readnum": "delim time",
            "readstr": "delim removecr discardheaders time line",
            "isfile": "fifo regfile blockspec charspec",
            "getsysdata": "taskref",
            "calcjointt": "usecurwobjpos",
            "getnextmechunit": "mecref drivemodule oktodeact",
            "readcfgdata": "listno",
        }.items()
    }
)
"""Options of system.rapid that a program may not use here; they are not passed to the implementations."""
