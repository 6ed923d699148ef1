"""Numbers and strings. Angles are in degrees, as everywhere in RAPID."""

import math
from types import MappingProxyType

from mock_robot.rapid.errors import RapidError
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.values import short, single


def acos(task: ProgramTask, value: float) -> float:
    if not -1.0 <= value <= 1.0:
        raise RapidError("ERR_ARGVALERR", f"Acos({value:g})")
    return single(math.degrees(math.acos(value)))


def sqrt(task: ProgramTask, value: float) -> float:
    if value < 0:
        raise RapidError("ERR_ARGVALERR", f"Sqrt({value:g})")
    return single(math.sqrt(value))


def trunc(task: ProgramTask, value: float, decimals: float | None) -> float:
    scale = 10.0 ** int(decimals or 0)
    return single(math.trunc(value * scale) / scale)


def n_orient(task: ProgramTask, rotation: list[float]) -> list[float]:
    norm = math.hypot(*rotation)
    if norm == 0.0:
        raise RapidError("ERR_ILLQUAT", "a rotation of zeros")
    return [single(part / norm) for part in rotation]


def num_to_str(task: ProgramTask, value: float, decimals: float, exponent: bool | None) -> str:
    places = int(decimals)
    return short(f"{value:.{places}E}" if exponent else f"{value:.{places}f}")


DOES = MappingProxyType(
    {
        "Abs": lambda task, value: abs(value),
        "Acos": acos,
        "Sqrt": sqrt,
        "Trunc": trunc,
        "Distance": lambda task, first, second: single(math.dist(first, second)),
        "NOrient": n_orient,
        "StrLen": lambda task, text: float(len(text)),
        "NumToStr": num_to_str,
    }
)
