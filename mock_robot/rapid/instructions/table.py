"""Implementations of system.rapid by name; each is called with its task, then its arguments in order."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.instructions import egm, flow, mathematics, motion, rawbytes, settings, signals, sockets

_TABLES = (egm, flow, mathematics, motion, rawbytes, settings, signals, sockets)

DOES: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name.casefold(): does for table in _TABLES for name, does in table.DOES.items()}
)

_OPTIONS: dict[str, str] = json.loads(Path(__file__).with_name("left_out.json").read_text("utf-8"))
LEFT_OUT: Mapping[str, frozenset[str]] = MappingProxyType(
    {name: frozenset(options.split()) for name, options in _OPTIONS.items()}
)
"""Options of system.rapid that a program may not use here; they are not passed to the implementations."""
