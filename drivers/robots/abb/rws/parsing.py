"""Converts values of RWS, all text, to base_T_flange, joints, status and log entries."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict

from calibration.errors import GeometryError
from calibration.transforms import Array, difference, rotation_from_quaternion, transform
from drivers.errors import GarbledAnswer
from drivers.interfaces import PoseReading, RobotStatus
from drivers.robots.abb.robtarget import MIN_UNUSED_AXIS, SEVEN, reading_of

STILL_MM, STILL_RAD = 0.02, math.radians(0.005)
"""Two readings further apart than this are taken for motion."""
AXES = "abcdef"
Values = Mapping[str, Any]


@dataclass(frozen=True)
class ControllerState:
    """State of the panel in the controller's words. `speed_ratio` of the pendant in percent."""

    controller: str
    mode: str
    execution: str
    speed_ratio: float

    def __str__(self) -> str:
        return f"{self.controller}, {self.mode}, RAPID {self.execution}, speed {self.speed_ratio:g} %"


@dataclass(frozen=True)
class EventLogEntry:
    """One entry of the controller's event log."""

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    number: int
    """Of the entry, counted by the controller."""
    kind: int
    """1 information, 2 warning, 3 error."""
    code: int
    """ABB's number of the event."""
    at: str
    """By the controller's clock, as it gives it."""
    title: str
    """ABB's title of the event."""
    description: str
    """ABB's description of the event."""


def pose(device: str, values: Values, taken_at_s: float, axes: int = 6) -> PoseReading:
    """Convert a robtarget, with `still` False, since one reading cannot show standstill. Raises GarbledAnswer."""
    base_T_flange = frame(device, values)
    quarters = _numbers(device, values, ("cf1", "cf4", "cf6", "cfx"))
    spelled = "eax_" if "eax_a" in values else "eax"
    external = _numbers(device, values, tuple(f"{spelled}{letter}" for letter in AXES))
    return reading_of(base_T_flange, quarters, external, axes, taken_at_s)


def frame(device: str, values: Values) -> Array:
    """Convert position (mm) and quaternion to a transform (4, 4). Raises GarbledAnswer."""
    x, y, z, *quaternion = _numbers(device, values, ("x", "y", "z", "q1", "q2", "q3", "q4"))
    try:
        return transform(rotation_from_quaternion(np.array(quaternion)), [x, y, z])
    except GeometryError as error:
        raise _garbage_error(device, str(error)) from error


def with_standstill(before: PoseReading, after: PoseReading) -> PoseReading:
    """The later reading, with `still` set when the two agree."""
    off_mm, off_rad = difference(before.base_T_flange, after.base_T_flange)
    return replace(after, still=off_mm <= STILL_MM and off_rad <= STILL_RAD)


def joints_rad(device: str, values: Values, axes: int = 6) -> Array:
    """Angles (axes,) of the arm's 6 or 7 axes in rad. Raises GarbledAnswer."""
    names = tuple(f"rax_{axis}" for axis in range(1, 7))
    degrees = _numbers(device, values, (*names, "eax_a") if axes == SEVEN else names)
    if max(degrees) >= MIN_UNUSED_AXIS:
        raise _garbage_error(device, "no axis 7 (eax_a is not used), and [robot] model names an arm with seven axes")
    angles_rad: Array = np.radians(np.array(degrees))
    return angles_rad


def status(state: ControllerState, moving: bool, taken_at_s: float) -> RobotStatus:
    """Status from the panel and whether the arm moved between two polls. Over RWS the arm is never armed."""
    return RobotStatus(
        motors_on=state.controller == "motoron",
        automatic=state.mode == "AUTO",
        emergency_stop=state.controller in ("emergencystop", "emergencystopreset"),
        moving=moving,
        in_position=not moving,
        armed=False,
        program_running=state.execution == "running",
        speed_limited=state.mode != "AUTO" or state.speed_ratio < 100,
        taken_at_s=taken_at_s,
    )


def word(device: str, values: Values, name: str) -> str:
    """A required value. Raises GarbledAnswer."""
    value = values.get(name)
    if not isinstance(value, str) or not value:
        raise _garbage_error(device, f"an answer without {name}")
    return value


def number(device: str, values: Values, name: str) -> float:
    """A required finite number. Raises GarbledAnswer."""
    return _numbers(device, values, (name,))[0]


def log_entry(device: str, values: Values) -> EventLogEntry:
    """Convert a log entry. Raises GarbledAnswer."""
    try:
        return EventLogEntry(
            number=int(str(values["_title"]).rpartition("/")[2]),
            kind=int(values["msgtype"]),
            code=int(values["code"]),
            at=str(values["tstamp"]),
            title=str(values.get("title", "")),
            description=str(values.get("desc", "")),
        )
    except (KeyError, ValueError, TypeError) as error:
        raise _garbage_error(device, f"a log entry that cannot be read ({error})") from error


def _numbers(device: str, values: Values, names: tuple[str, ...]) -> list[float]:
    try:
        numbers = [float(values[name]) for name in names]
    except (KeyError, ValueError, TypeError) as error:
        raise _garbage_error(device, f"an answer without the number {error}") from error
    if not all(math.isfinite(each) for each in numbers):
        raise _garbage_error(device, f"a number that is none among {dict(zip(names, numbers, strict=True))}")
    return numbers


def _garbage_error(device: str, what: str) -> GarbledAnswer:
    return GarbledAnswer(device, what, "nothing is done with it; check that the address is a controller's")
