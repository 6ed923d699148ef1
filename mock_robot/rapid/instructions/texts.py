"""Strings and bits that programs in the field build their messages of."""

import re
from math import asin, degrees, exp
from types import MappingProxyType
from typing import Any

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.scope import Slot
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import integer, short, single

_PLACE = re.compile(r"\{(\d)\}")
_BASES = (16, 8, 2)
BITS = 8


def format_text(task: ProgramTask, text: str, *values: str | None) -> str:
    """{1} to {9} are replaced by \\Arg1 to \\Arg9, which count from 1."""
    return short(_PLACE.sub(lambda found: values[int(found[1]) - 1] or "" if 0 < int(found[1]) <= 9 else "", text))


def byte_to_str(
    task: ProgramTask, value: int, hexadecimal: bool | None, octal: bool | None, binary: bool | None, char: bool | None
) -> str:
    if char:
        return chr(value)
    return f"{value:02X}" if hexadecimal else f"{value:03o}" if octal else f"{value:08b}" if binary else str(value)


def str_to_byte(task: ProgramTask, text: str, *switches: bool | None) -> int:
    *bases, char = switches
    base = next((base for base, given in zip(_BASES, bases, strict=True) if given), 10)
    try:
        value = ord(text) if char else int(text, base)
    except (TypeError, ValueError):
        value = -1
    if not 0 <= value <= 255:
        raise RapidError("ERR_ARGVALERR", f"{text!r} is no byte")
    return value


def is_member(task: ProgramTask, text: str, place: float, characters: str) -> bool:
    at = integer(place)
    if not 1 <= at <= len(text):
        raise RapidError("ERR_OUTOFBND", f"character {at} of {len(text)}")
    return text[at - 1] in characters


def map_text(task: ProgramTask, text: str, source: str, target: str) -> str:
    return text.translate({ord(a): b for a, b in zip(source, target, strict=False)})


def dec_to_hex(task: ProgramTask, text: str) -> str:
    return f"{int(text):X}"


def hex_to_dec(task: ProgramTask, text: str) -> str:
    return str(int(text, 16))


def bit_check(task: ProgramTask, value: int, place: float) -> bool:
    return bool(value >> _bit(place) & 1)


def bit_check_dnum(task: ProgramTask, value: float, place: float) -> bool:
    return bool(integer(value) >> integer(place) - 1 & 1)


def bit_set(task: ProgramTask, data: Slot, place: float) -> None:
    data.value = int(data.value) | 1 << _bit(place)


def bit_clear(task: ProgramTask, data: Slot, place: float) -> None:
    data.value = int(data.value) & ~(1 << _bit(place))


def _bit(place: float) -> int:
    if not 1 <= integer(place) <= BITS:
        raise RapidError("ERR_ARGVALERR", f"bit {place:g} of a byte")
    return integer(place) - 1


def arc_sine(task: ProgramTask, value: float) -> float:
    if not -1.0 <= value <= 1.0:
        raise RapidError("ERR_ARGVALERR", f"ASin of {value:g}")
    return single(degrees(asin(value)))


def exponential(task: ProgramTask, value: float) -> float:
    return single(exp(value))


def dot_product(task: ProgramTask, first: list[float], second: list[float]) -> float:
    return single(sum(a * b for a, b in zip(first, second, strict=True)))


def magnitude(task: ProgramTask, vector: list[float]) -> float:
    return single(dot_product(task, vector, vector) ** 0.5)


def length_of_array(task: ProgramTask, array: tuple[Any, Any], dimension: float) -> float:
    values = array[1]
    for _ in range(integer(dimension) - 1):
        values = values[0] if isinstance(values, list) and values else None
    if not isinstance(values, list):
        raise RapidError("ERR_ARGVALERR", f"no dimension {dimension:g}")
    return float(len(values))


DOES = MappingProxyType(
    {
        "StrFormat": format_text,
        "ByteToStr": byte_to_str,
        "StrToByte": str_to_byte,
        "StrMemb": is_member,
        "StrMap": map_text,
        "DecToHex": dec_to_hex,
        "HexToDec": hex_to_dec,
        "BitCheck": bit_check,
        "BitCheckDnum": bit_check_dnum,
        "BitSet": bit_set,
        "BitClear": bit_clear,
        "BitAnd": lambda task, first, second: first & second,
        "BitOr": lambda task, first, second: first | second,
        "BitXOr": lambda task, first, second: first ^ second,
        "BitNeg": lambda task, value: ~value & 0xFF,
        "BitLSh": lambda task, value, steps: value << integer(steps) & 0xFF,
        "BitRSh": lambda task, value, steps: value >> integer(steps),
        "ASin": arc_sine,
        "Exp": exponential,
        "DotProd": dot_product,
        "VectMagn": magnitude,
        "Dim": length_of_array,
        "NumToDnum": lambda task, value: value,
        "DnumToNum": lambda task, value, whole: single(value),
    }
)
