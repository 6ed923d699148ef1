"""Answers of the first set-up, each checked, and the settings file that follows from them; no device is asked here."""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from calibration.documents.pose import PoseDocument
from calibration.knowledge import INSTRUMENT_ERRORS, Instrument
from calibration.problem import Setup
from calibration.targets import AprilTagGrid, ArucoGrid, ArucoMarker, Charuco, Chessboard, CircleGrid, Target
from calibration.transforms import Array
from daemon.config.server_settings import ServerSettings
from daemon.config.toml_text import toml_text
from daemon.errors import AnswerRefused

MIN_BOX_MM, MAX_TOLERANCE_MM, MAX_EDGE_MM = 50.0, 50.0, 2000.0
HALF_MM, SNAP_SHARE = 0.5, 0.04
"""A second length of the target is proposed in these steps when it is so near to one, as a share."""

STORE = "store"
"""Folder of what the daemon keeps, beside the settings file."""

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


@dataclass(frozen=True)
class CellAnswers:
    """All that was asked. `base_frame`: where the base stands in the controller's world; None: they are one."""

    controller: str
    model: str | None
    base_frame: PoseDocument | None
    camera: str
    setup: Setup
    size: TargetSize
    tolerance_mm: float
    box_mm: tuple[Corner, Corner]
    port: int = ServerSettings().port

    def settings_text(self) -> str:
        """The settings file: what was asked, and nothing that has a default."""
        frame = None if self.base_frame is None else self.base_frame.model_dump(mode="json")
        robot = {"address": self.controller, "model": self.model, "base_frame": frame, "box_mm": self.box_mm}
        values = {name: value for name, value in asdict(self.size.target).items() if value is not False}
        target = {"kind": self.size.target.kind, **values}
        return "# What `handeyed init` asked. handeyed.example.toml has every other setting.\n" + toml_text(
            {
                "robot": robot,
                "camera": {"address": self.camera, "setup": self.setup},
                "target": target,
                "calibration": {"tolerance_mm": self.tolerance_mm},
                "calibration.known.target": self.size.known,
                "storage": {"folder": STORE},
                "server": {} if self.port == ServerSettings().port else {"port": self.port},
            }
        )


def parse_setup(text: str) -> Setup:
    """Where the camera is: eye-in-hand (on the arm) or eye-to-hand. Raises AnswerRefused."""
    words: dict[str, Setup] = {"arm": "eye-in-hand", "beside": "eye-to-hand"}
    words |= {setup: setup for setup in tuple(words.values())}
    try:
        return words[text.strip().lower()]
    except KeyError:
        raise AnswerRefused(f"{text[:40]!r} is no place of the camera", "answer arm or beside") from None


def describe_target(target: Target) -> str:
    """A recognised target in words: its kind, columns and rows, markers."""
    values = {name: value for name, value in asdict(target).items() if not name.endswith("_mm")}
    size = f"{values.pop('columns')} x {values.pop('rows')}" if "columns" in values else ""
    counted = {Chessboard: "inner corners", Charuco: "squares", CircleGrid: "dots"}.get(type(target), "")
    others = (f"{name} {value}" for name, value in values.items() if value not in (None, False))
    return ", ".join([" ".join(filter(None, (target.kind, size, counted))), *others])


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
        second = edge * float(getattr(recognised, second_name))
        near = max(round(second / HALF_MM) * HALF_MM, HALF_MM)
        second = near if abs(near - second) < SNAP_SHARE * second else round(second, 2)
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


def keep_old(file: Path) -> Path | None:
    """Rename the file that is there to the first free of FILE.1, FILE.2, ...; None when there was none."""
    if not file.exists():
        return None
    kept = next(path for number in range(1, 1000) if not (path := file.with_name(f"{file.name}.{number}")).exists())
    return file.rename(kept)
