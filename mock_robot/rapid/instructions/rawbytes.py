"""Packing to and from rawbytes: little-endian unless \\Network, positions from 1."""

import struct
from collections.abc import Mapping
from struct import Struct
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import BYTE, NUM, STRING, Type
from mock_robot.rapid.values import MAX_STRING_LENGTH, integer, single

INTEGERS: Mapping[float, str] = MappingProxyType({1: "B", 2: "H", 4: "I", -1: "b", -2: "h", -4: "i"})
"""struct's letter for the constants USINT, UINT, UDINT, SINT, INT, DINT of system.rapid."""
_INTEGER_LAYOUTS = MappingProxyType(
    {
        (kind, network): Struct((">" if network else "<") + INTEGERS[kind])
        for kind in INTEGERS
        for network in (None, True)
    }
)
_FLOAT_LAYOUTS = MappingProxyType({None: Struct("<f"), True: Struct(">f")})


def copy(
    task: ProgramTask, source: Slot, from_index: float, target: Slot, to_index: float, count: float | None
) -> None:
    first = integer(from_index)
    number = source.value.length - first + 1 if count is None else integer(count)
    target.value.write(integer(to_index), source.value.read(first, number))


def pack(
    task: ProgramTask,
    value: tuple[Type, Any],
    raw: Slot,
    network: bool | None,
    index: float,
    hex1: bool | None,
    int_x: float | None,
    float4: bool | None,
    ascii_: bool | None,
) -> None:
    kind, content = value
    if kind == NUM and int_x is not None:
        packed = _pack(INTEGERS[int_x], network, integer(content))
    elif kind == NUM and float4:
        packed = _pack("f", network, content)
    elif kind == BYTE and (hex1 or ascii_):
        packed = bytes([content])
    elif kind == STRING and ascii_:
        packed = content.encode("latin-1")
    else:
        raise RapidError("ERR_ARGVALERR", f"{kind.name} cannot be packed so")
    raw.value.write(integer(index), packed)


def _pack(letter: str, network: bool | None, value: float) -> bytes:
    try:
        return struct.pack((">" if network else "<") + letter, value)
    except struct.error as error:
        raise RapidError("ERR_ARGVALERR", f"{value:g} cannot be packed: {error}") from None


def unpack(
    task: ProgramTask,
    raw: Slot,
    network: bool | None,
    index: float,
    value: tuple[Type, Slot],
    hex1: bool | None,
    int_x: float | None,
    float4: bool | None,
    ascii_: float | None,
) -> None:
    kind, slot = value
    first = integer(index)
    if kind is NUM and int_x is not None:
        slot.value = single(float(raw.value.number(_INTEGER_LAYOUTS[int_x, network], first)))
    elif kind is NUM and float4:
        slot.value = raw.value.number(_FLOAT_LAYOUTS[network], first)
    elif kind == BYTE and hex1:
        slot.value = raw.value.read(first, 1)[0]
    elif kind == STRING and ascii_ is not None and 1 <= ascii_ <= MAX_STRING_LENGTH:
        slot.value = raw.value.read(first, integer(ascii_)).decode("latin-1")
    else:
        raise RapidError("ERR_ARGVALERR", f"{kind.name} cannot be unpacked so")


DOES = MappingProxyType(
    {
        "ClearRawBytes": lambda task, raw, start: raw.value.clear(1 if start is None else integer(start)),
        "CopyRawBytes": copy,
        "RawBytesLen": lambda task, raw: float(raw.value.length),
        "PackRawBytes": pack,
        "UnpackRawBytes": unpack,
    }
)
