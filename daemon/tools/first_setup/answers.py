"""Answers of the first set-up, each checked, and the settings file that follows from them; no device is asked here."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from calibration.knowledge import INSTRUMENT_ERRORS, Instrument
from calibration.problem import Setup
from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Chessboard, CircleGrid, Target
from calibration.transforms import Array
from daemon.errors import AnswerRefused

MIN_BOX_MM, MAX_TOLERANCE_MM, MAX_EDGE_MM = 50.0, 50.0, 2000.0
HALF_MM, MARKER_SHARE, SNAP_SHARE = 0.5, 0.75, 0.04
"""A second length is proposed in these steps, a marker's as this share of the square, when it is so near (a share)."""

Corner = tuple[float, float, float]
EDGES: dict[type, tuple[str, str | None, str, str]] = {
    Chessboard: ("pitch_mm", None, "edge of a square", ""),
    Charuco: ("square_mm", "marker_mm", "edge of a square", "edge of a marker"),
    CircleGrid: ("pitch_mm", None, "distance from dot to dot in a row", ""),
    AprilTagGrid: ("tag_mm", "gap_mm", "edge of a tag", "gap between two"),
    ArucoGrid: ("marker_mm", "gap_mm", "edge of a marker", "gap between two"),
    ArucoMarker: ("marker_mm", None, "edge of the marker", ""),
}
"""By kind of target: the settings of its length and of the second one, and what they are called."""

INSTRUMENTS: dict[str, Instrument] = {
    **{name: name for name in INSTRUMENT_ERRORS},
    "caliper": "calliper",
    "ruler": "ruler-class-2",
}
_NUMBER = r"\d+(?:[.,]\d+)?"
_SIZE = re.compile(rf"({_NUMBER})(?:\s*/\s*(\d+))?(?:\s+({_NUMBER}))?(?:\s+([a-z][a-z0-9-]*))?", re.IGNORECASE)


@dataclass(frozen=True)
class TargetSize:
    """A target with its lengths, and how they are known: `known` is the section [calibration.known.target]."""

    target: Target
    known: dict[str, Any]


def parse_setup(text: str) -> Setup:
    """Where the camera is: eye-in-hand (on the arm) or eye-to-hand. Raises AnswerRefused."""
    words: dict[str, Setup] = {"arm": "eye-in-hand", "beside": "eye-to-hand"}
    words |= {setup: setup for setup in tuple(words.values())}
    try:
        return words[text.strip().lower()]
    except KeyError:
        raise AnswerRefused(f"{text[:40]!r} is no place of the camera", "answer arm or beside") from None


def parse_size(text: str, recognised: Any) -> TargetSize:
    """The recognised target with the lengths of an answer: LENGTH[/COUNT] [SECOND] [INSTRUMENT], in mm.

    220/10 is 22, measured over ten. Without SECOND the picture's proportion is taken. Raises AnswerRefused.
    """
    name, second_name, what, second_what = EDGES[type(recognised)]
    answer = _SIZE.fullmatch(text.strip())
    if answer is None:
        example = f"220/10{'' if second_name is None else ' 16.5'} calliper"
        raise AnswerRefused(f"{text[:40]!r} is no {what}", f"write it in mm, as 22 or {example}")
    length, count = float(answer[1].replace(",", ".")), int(answer[2] or 1)
    edge = length / max(count, 1)
    if not 0 < edge <= MAX_EDGE_MM or count < 1:
        raise AnswerRefused(f"{text[:40]!r} gives {edge:g} mm", f"the {what} is above 0 and up to {MAX_EDGE_MM:g} mm")
    lengths = {name: round(edge, 4)}
    if second_name is None and answer[3] is not None:
        raise AnswerRefused(f"a {recognised.kind} has one length", f"write the {what} alone")
    if second_name is not None:
        seen = edge * float(getattr(recognised, second_name))
        grid = max(round(seen / HALF_MM) * HALF_MM, HALF_MM)
        usual = (MARKER_SHARE * edge, grid) if second_name == "marker_mm" else (grid,)
        second = next((each for each in usual if abs(each - seen) < SNAP_SHARE * seen), round(seen, 2))
        lengths[second_name] = second if answer[3] is None else float(answer[3].replace(",", "."))
        if second_name == "marker_mm" and not 0 < lengths[second_name] < edge:
            raise AnswerRefused(f"{lengths[second_name]:g} mm is no {second_what}", "it is smaller than the square")
    known: dict[str, Any] = {}
    if answer[4] is not None:
        if answer[4].lower() not in INSTRUMENTS:
            raise AnswerRefused(f"{answer[4][:40]!r} is no instrument", f"use one of {', '.join(INSTRUMENTS)}")
        known = {"source": "measured", "length_mm": length, "instrument": INSTRUMENTS[answer[4].lower()]}
    return TargetSize(replace(recognised, **lengths), known)


def parse_tolerance(text: str) -> float:
    """The largest uncertainty U in mm. Raises AnswerRefused."""
    number = text.strip().removesuffix("mm").strip().replace(",", ".")
    if not re.fullmatch(r"\d+(?:\.\d+)?", number) or not 0 < float(number) <= MAX_TOLERANCE_MM:
        raise AnswerRefused(
            f"{text[:40]!r} is no tolerance", f"write mm above 0 and up to {MAX_TOLERANCE_MM:g}, as 1.0"
        )
    return float(number)


def parse_corners(text: str, flange_mm: Corner, program_mm: tuple[Corner, Corner] | None) -> list[Corner]:
    """The corners that an answer gives: one or two as x y z in mm; `here`, where the flange stands; or `program`.

    `program_mm`: the box that the robot's program allows. Raises AnswerRefused.
    """
    words = re.split(r"[\s;,\[\]()]+", text.strip(" [](),;"))
    if words == ["here"]:
        return [flange_mm]
    if words == ["program"]:
        if program_mm is None:
            raise AnswerRefused("the robot's program states no box", "write two corners, or here at each of them")
        return list(program_mm)
    if len(words) not in (3, 6) or not all(re.fullmatch(r"[-+]?\d+(?:\.\d+)?", word) for word in words):
        raise AnswerRefused(f"{text[:60]!r} is no corner", "write x y z of one corner or two, in mm, or here")
    numbers = [float(word) for word in words]
    return [(numbers[k], numbers[k + 1], numbers[k + 2]) for k in range(0, len(numbers), 3)]


def box_of(corners: Sequence[Corner], flange_mm: Corner) -> tuple[Corner, Corner]:
    """Lowest and highest corner (mm, base) of the box between two corners. Raises AnswerRefused."""
    low = tuple(round(min(pair), 1) for pair in zip(*corners, strict=True))
    high = tuple(round(max(pair), 1) for pair in zip(*corners, strict=True))
    thin = [axis for axis, a, b in zip("xyz", low, high, strict=True) if b - a < MIN_BOX_MM]
    if thin:
        raise AnswerRefused(f"the box is thinner than {MIN_BOX_MM:g} mm in {', '.join(thin)}", "take opposite corners")
    if not all(a <= value <= b for a, value, b in zip(low, flange_mm, high, strict=True)):
        at = ", ".join(f"{value:.0f}" for value in flange_mm)
        raise AnswerRefused(f"the flange stands outside the box, at ({at})", "jog it inside, or give a larger box")
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def corner_of(base_T_flange: Array) -> Corner:
    """The flange's place in mm."""
    x, y, z = (round(float(value), 1) for value in base_T_flange[:3, 3])
    return x, y, z
