"""Whose poses named numbers are, by their names: the robot's, the camera's, or a result of a calibration.

A name says frames: `R_gripper2base`, `eef_to_base`, `base_T_ee`, `object_wrt_sensor`, `hand_world_samples`, or one of
them only: `robot_coords`, `rvec_marker`. The last part of a path that says any decides; `rvec` and `tvec`, what
detectors call their numbers, count where nothing else does.
"""

import contextlib
import json
import re
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calibration.documents.imports.pose_table import PoseTable
from calibration.errors import DocumentError
from calibration.kinematics.conventions import Frame, Side

WORDS: dict[str, Any] = json.loads(Path(__file__).with_name("words.json").read_text(encoding="utf-8"))
"""The words of names by what they say, separated by blanks; those of the frame `base` also mean the robot as a whole.

`letters`: what frames of one letter say, as in bTg, fMe and cMo.
"""

WORD_FRAMES = {word: frame for frame, words in WORDS["frames"].items() for word in words.split()}
SIDES: dict[str, Side] = {"base": "robot", "flange": "robot", "camera": "camera", "target": "camera"}
DETECTOR_WORDS = frozenset(("rvec", "rvecs", "tvec", "tvecs", "rmat", "rmats"))
CONNECTORS = {"2": False, "to": False, "t": True, "in": False, "wrt": False, "from": True}
"""Between the frames a and b: whether the numbers map b to a (base_T_flange) and not a to b (gripper2base)."""

LETTERS = {pair: said for said, pairs in WORDS["letters"].items() for pair in pairs.split()}
_LETTERS = re.compile(r"(?<![A-Za-z])([a-z])[TMHP]([a-z])(?![A-Za-z])")
_JOINED = re.compile(r"([a-z]+)(2|to|in|wrt)([a-z]+)")


@dataclass(frozen=True)
class Relation:
    """Whose numbers they are (None: neither's, such as X itself), and in which direction, where the name says it.

    frame : of the camera's poses base_T_flange stands for camera_T_target, flange_T_base for its inverse.
    """

    side: Side | None
    frame: Frame | None = None
    weak: bool = False


def relation_of(path: str) -> Relation | None:
    """What a path of names (parts between dots or slashes) says; None for nothing."""
    path = "".join(one for one in unicodedata.normalize("NFD", path) if not unicodedata.combining(one))
    path = re.sub(r"(?<=[\u3040-\u9fff])(?=[A-Za-z0-9])", "_", path)
    path = _LETTERS.sub(lambda letters: LETTERS.get(letters[1] + letters[2], letters[0]), path)
    parts = re.split(r"[./]", re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", "_", path))
    for part in reversed(parts):
        if (relation := _of_part(part)) is not None:
            return relation
    words = {word for part in parts for word in _words(part)}
    return Relation("camera", weak=True) if words & DETECTOR_WORDS else None


def _words(part: str) -> list[str]:
    """The words of a part; `gripper2base` is three."""
    words = []
    for word in (
        re.sub(r"(?<=[a-z])\d+$", "", one) if one != "tool0" else one for one in re.split(r"[\W_]+", part.lower())
    ):
        joined = _JOINED.fullmatch(word)
        if joined and joined[1] in WORD_FRAMES and joined[3] in WORD_FRAMES:
            words += [joined[1], joined[2], joined[3]]
        else:
            words.append(word[:-1] if word[:-1] in WORD_FRAMES and word not in WORD_FRAMES else word)
    return [word for word in words if word]


def _of_part(part: str) -> Relation | None:
    words = _words(part)
    frames = [(at, WORD_FRAMES[word]) for at, word in enumerate(words) if word in WORD_FRAMES]
    if not frames:
        return None
    sides = {SIDES[frame] for _, frame in frames}
    if len(sides) > 1:
        connected = any(word in CONNECTORS for word in words)
        return Relation(None) if connected else Relation(SIDES[frames[0][1]])
    (first, a), (last, b) = frames[0], frames[-1]
    connector = next((word for word in words[first + 1 : last] if word in CONNECTORS), None)
    if connector is None or a == b:
        return Relation(sides.pop())
    inner, outer = (b, a) if CONNECTORS[connector] else (a, b)
    inverted = (inner, outer) in (("base", "flange"), ("camera", "target"))
    return Relation(sides.pop(), "flange_T_base" if inverted else "base_T_flange")


def build_by_sides(names: Sequence[str], shared: Sequence[int], build: Callable[[list[int]], PoseTable]) -> PoseTable:
    """What `build` makes of the indices of the names: of the robot's, with the camera's beside it, where both are
    named and are poses; else of all of them. `shared`: indices that belong to both, such as a picture's name.

    Where only one side is named, names that say nothing are the other's if they can be: a detector's are the camera's.
    """
    relations = [relation_of(name) for name in names]
    named = {one.side for one in relations if one is not None and not one.weak}
    indices: dict[Side | None, list[int]] = {"robot": [], "camera": [], None: []}
    for index, one in enumerate(relations):
        if index not in shared:
            indices[None if one is None or (one.weak and "robot" not in named) else one.side].append(index)
    if not indices["robot"] and not indices["camera"]:
        with contextlib.suppress(DocumentError):  # a detector's pose beside one of no name, which is then the robot's
            weak = [index for index in indices[None] if relations[index] is not None]
            camera = replace(build([*weak, *shared]), side="camera")
            return replace(build([*sorted({*indices[None]} - {*weak}), *shared]), side="robot", camera=camera)
        return _with_relation(build([*range(len(names))]), relations, range(len(names)))
    found: dict[Side, PoseTable] = {}
    for side, others in (("robot", indices["robot"]), ("camera", indices["camera"])):
        try:
            found[side] = _with_relation(build([*others, *shared]), relations, others)  # type: ignore[index]
        except DocumentError:
            continue
    if len(found) == 1:
        (side,) = found
        nobodys = [index for index in indices[None] if relations[index] is None or relations[index].weak]  # type: ignore[union-attr]
        with contextlib.suppress(DocumentError):
            other: Side = "camera" if side == "robot" else "robot"
            if side == "camera":  # a pose of no name beside the camera's is the robot's
                found[other] = replace(build([*nobodys, *shared]), side=other)
    if len(found) == 2:
        robot, camera = found["robot"], found["camera"]
        return replace(robot, side="robot", camera=replace(camera, side="camera"))
    if "robot" in found:
        every = build([*indices["robot"], *indices[None], *shared]) if len(indices[None]) else found["robot"]
        return replace(every, side="robot", named_frame=found["robot"].named_frame)
    return build([*range(len(names))]) if not found else found["camera"]


def _with_relation(table: PoseTable, relations: Sequence[Relation | None], indices: Iterable[int]) -> PoseTable:
    """The table with the side and the direction that the names say."""
    said = next((one for index in indices if (one := relations[index]) is not None), None)
    if said is None:
        return table
    return replace(table, side=said.side, named_frame=said.frame)
