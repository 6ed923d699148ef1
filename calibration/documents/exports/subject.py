"""What a format writes: X of one calibration between two named frames, with its numbers as text."""

import re
from dataclasses import dataclass
from pathlib import Path
from string import Template

import numpy as np

from calibration.documents.calibration import TRANSFORM_NAMES, CalibrationDocument
from calibration.documents.pose import PoseDocument
from calibration.errors import ExportRefused
from calibration.kinematics.conventions import CONVENTIONS, numbers_of
from calibration.transforms import Array, inverse, transform

OPTICAL_FRAME, BODY_FRAME = "camera_optical_frame", "camera_link"
"""Frames of a camera: OpenCV's (x right, y down, z ahead), and REP 103's (x ahead, y left, z up)."""

FRAME_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,59}(/[A-Za-z0-9_]{1,60}){0,3}")
DEFAULT_DECIMALS, MAX_DECIMALS = 4, 9

LINK_T_OPTICAL = transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
"""The optical frame in the body frame of the same camera (REP 103)."""


def fixed(value: float, decimals: int) -> str:
    """`value` with that many decimals, never as minus zero."""
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def single(value: float) -> str:
    """`value` as a single float, RAPID's num: nine digits, which restore its every bit."""
    return f"{float(np.float32(value)) + 0.0:.9g}"


@dataclass(frozen=True)
class ExportOptions:
    """`parent`: name of the flange or base frame, by default tool0 or base. `child`: of the camera's; a name that ends
    with camera_link is its body frame. `decimals`: of lengths in mm."""

    parent: str | None = None
    child: str = OPTICAL_FRAME
    decimals: int = DEFAULT_DECIMALS

    def check(self) -> None:
        """Raises ExportRefused for a name that is no frame's, or for decimals outside 0 to MAX_DECIMALS."""
        for name in (self.parent or "tool0", self.child):
            if not FRAME_NAME.fullmatch(name):
                what = f"{name[:80]!r} is no name of a frame"
                raise ExportRefused(what, "use letters, digits and underscores, a letter first")
        if not 0 <= self.decimals <= MAX_DECIMALS:
            raise ExportRefused(f"{self.decimals} decimals", f"use 0 to {MAX_DECIMALS}")


@dataclass(frozen=True)
class Subject:
    """X: `parent_T_child` (4, 4) in mm, its frames' names, and the calibration it comes from."""

    calibration: CalibrationDocument
    parent: str
    child: str
    parent_T_child: Array
    decimals: int

    @property
    def calibration_id(self) -> str:
        """The id, without what could end a comment."""
        return re.sub(r"-{2,}", "-", re.sub(r"[^A-Za-z0-9._-]", "?", self.calibration.id))[:64]

    @property
    def on_flange(self) -> bool:
        """True for eye-in-hand: the camera is a tool."""
        return self.calibration.setup == "eye-in-hand"

    @property
    def x_name(self) -> str:
        """The transform's name in calibration.json."""
        return TRANSFORM_NAMES[self.calibration.setup][0]

    @property
    def target_name(self) -> str:
        """The name of the target's pose in calibration.json."""
        return TRANSFORM_NAMES[self.calibration.setup][1]

    @property
    def parent_T_target(self) -> Array | None:
        """The target's pose (4, 4): in the base for eye-in-hand, in the flange for eye-to-hand."""
        pose: PoseDocument | None = getattr(self.calibration, self.target_name)
        return None if pose is None else pose.transform()

    @property
    def is_body_frame(self) -> bool:
        """Whether `child` is the camera's body frame."""
        return self.child.endswith(BODY_FRAME)

    def about(self) -> list[str]:
        """Lines for a comment: verdict, id, frames."""
        axes = "x ahead, y left, z up" if self.is_body_frame else "x right, y down, z ahead"
        lines = [
            f"handeyed calibration {self.calibration_id}: {self.x_name}, {self.child} in {self.parent}",
            f"axes of {self.child}: {axes}",
        ]
        for params in (one.params for one in self.calibration.verdict.findings if one.code == "poses-of-a-tool"):
            names = re.sub(r"[^A-Za-z0-9 ,._]+", "_", str(params.get("names")))[:200]
            lines.append(f"CAUTION: the robot's poses were of {names}, not of the flange in the base")
        if not self.calibration.verdict.accepted:
            lines.insert(0, "NOT ACCEPTED: the verdict on this calibration is negative")
        return lines

    def filled(self, template: str, **values: str) -> str:
        """The file of that name in `templates`, its $places filled with the frames' names and `values`."""
        text = (Path(__file__).parent / "templates" / template).read_text(encoding="utf-8")
        return Template(text).substitute(parent=self.parent, child=self.child, **values)

    def comment(self, marker: str, *more: str) -> str:
        """`about` and `more`, each line behind `marker`, with a line feed at the end."""
        return "".join(f"{marker} {line}\n" for line in [*self.about(), *more])

    def millimetres(self) -> list[str]:
        """x, y, z in mm."""
        return [fixed(value, self.decimals) for value in self.parent_T_child[:3, 3]]

    def metres(self) -> list[str]:
        """x, y, z in metres."""
        return [fixed(value / 1000, self.decimals + 3) for value in self.parent_T_child[:3, 3]]

    def turn(self, convention: str, rotation: Array | None = None) -> list[str]:
        """The numbers of that convention of a rotation (3, 3), by default X's; a quaternion's w is not negative."""
        numbers = numbers_of(convention, self.parent_T_child[:3, :3] if rotation is None else rotation)
        return [fixed(one, self.decimals + (1 if CONVENTIONS[convention].degrees else 5)) for one in numbers]


def tool_of(calibration: CalibrationDocument) -> str | None:
    """The tool or work object to which X is relative in place of flange or base, as letters and digits."""
    found = (one.params for one in calibration.verdict.findings if one.id == "poses-of-a-tool")
    named = (re.sub(r"\W+", "_", str(params.get("frame")), flags=re.ASCII).strip("_")[:40] for params in found)
    return next((name if FRAME_NAME.fullmatch(name) else f"frame_{name}" for name in named), None)


def subject_of(calibration: CalibrationDocument, options: ExportOptions) -> Subject:
    """X of `calibration`. Raises ExportRefused when it has none, or for `options` that cannot be."""
    options.check()
    name = TRANSFORM_NAMES[calibration.setup][0]
    pose: PoseDocument | None = getattr(calibration, name)
    if pose is None:
        what = f"calibration {calibration.id[:64]!r} has no {name}: its motions do not determine it"
        raise ExportRefused(what, "calibrate again as its findings advise")
    usual = "tool0" if calibration.setup == "eye-in-hand" else "base"
    parent = options.parent or tool_of(calibration) or usual
    body = options.child.endswith(BODY_FRAME)
    parent_T_child = pose.transform() @ inverse(LINK_T_OPTICAL) if body else pose.transform()
    return Subject(calibration, parent, options.child, parent_T_child, options.decimals)
