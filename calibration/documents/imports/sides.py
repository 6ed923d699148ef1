"""Whose poses named numbers are, by their names: the robot's, the camera's, or a result of a calibration.

A name says frames: `R_gripper2base`, `eef_to_base`, `base_T_ee`, `object_wrt_sensor`, `hand_world_samples`, or one of
them only: `robot_coords`, `rvec_marker`. The last part of a path that says any decides; `rvec` and `tvec`, what
detectors call their numbers, count where nothing else does.

Of the robot's own frames the flange is meant: a tool's poses are said to be that, or become the flange's by its offset.

Without names the rotations say which numbers go together, by the angles between views (`angle_agreement`).
"""

import json
import re
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calibration.diagnosis.angle_agreement import angles_between, mean_mismatch_rad
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import refusal
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.conventions import Convention, Frame, Side
from calibration.problem import PosesOf
from calibration.transforms import Array

WORDS: dict[str, Any] = json.loads(Path(__file__).with_name("words.json").read_text(encoding="utf-8"))
"""The words of names by what they say, separated by blanks; those of the frame `base` also mean the robot as a whole.

`letters`: what frames of one letter say, as in bTg, fMe and cMo.
"""

WORD_FRAMES = {word: frame for frame, words in WORDS["frames"].items() for word in words.split()}
SIDES: dict[str, Side] = {"base": "robot", "flange": "robot", "camera": "camera", "target": "camera"}
DETECTOR_WORDS = frozenset(("rvec", "rvecs", "tvec", "tvecs", "rmat", "rmats"))
CONNECTORS = {"2": False, "to": False, "t": True, "in": False, "wrt": False, "from": True}
"""Between the frames a and b: whether the numbers map b to a (base_T_flange) and not a to b (gripper2base)."""

OPENCV = re.compile(r"(?<![a-z])(gripper2base|base2gripper|target2cam)(?![a-z])", re.IGNORECASE)
"""Names of OpenCV's own parameters, which say a direction in OpenCV's sense only.
Source: calibrateHandEye and calibrateRobotWorldHandEye in OpenCV's documentation of the module calib3d."""

LETTERS = {pair: said for said, pairs in WORDS["letters"].items() for pair in pairs.split()}
SPELT = {pair: "T_" + said.replace("_T_", "_") for pair, said in LETTERS.items()}  # T_base_flange of T_be
_LETTERS = re.compile(r"(?<![A-Za-z])([a-z])[TMHP]([a-z])(?![A-Za-z])")
_BEHIND = re.compile(r"(?<![A-Za-z])(?:[TRHMt]_[a-z]_?[a-z]|[TRHM]_[A-Z]_?[A-Z])(?![A-Za-z])")  # T_be, T_b_e, T_B_E
_OF_TWO = re.compile(r"(?<![A-Za-z])[TH]_([A-Za-z]+0?)_([A-Za-z]+0?)")  # T_cam_board: board to cam, mostly
_JOINED = re.compile(r"([a-z]+)(2|to|in|wrt)([a-z]+)")

MAX_MISMATCH_RAD, MORE_MISMATCH_RAD = float(np.radians(2.0)), float(np.radians(0.2))
"""Mean difference of the angles up to which two sides agree; and by how much more than the best pair's those of other
conventions may differ, which are compared by the translations as well."""

MIN_PAIRS, MAX_COMPARED = 3, 40  # views by which conventions are compared
MAX_STEP_SHARE = 0.1
"""Usual distance of a row from the next, as a share of what all rows span, below which they are samples of a path."""

Build = Callable[[Sequence[int], Sequence[str]], PoseTable]  # makes a table of the columns of these indices, so called

_TOOL = re.compile(r"(?<![a-z])(?:tcp|tool|werkzeug)(?![a-z0-9])|(?<=O_T_)EE", re.IGNORECASE)
_OFFSET = re.compile(r"(tcp|tool)_?offset|flange(2|_T_|_to_)(tcp|tool|ee)|\bF_T_EE", re.IGNORECASE)
_NO_POSE = r"speed|vel(ocity)?(?![a-z])|twist|force|wrench|torque|acc(el)?(?![a-z])|T_NE|NE_T|EE_T_K|O_T_EE_"
_COMMANDED = re.compile(r"(?<![a-z0-9_])target_(?:tcp|flange|q(?=_\d|$))", re.IGNORECASE)  # UR's, beside actual_
_BESIDE = re.compile(f"{_OFFSET.pattern}|{_NO_POSE}", re.IGNORECASE)
"""Of a moving frame, but no pose of it in the base. F_T_EE, O_T_EE_d and more: libfranka's RobotState."""


@dataclass(frozen=True)
class Relation:
    """Whose numbers they are (None: neither's, such as X itself), and in which direction, where the name says it.

    frames : of the camera's poses base_T_flange stands for camera_T_target, flange_T_base for its inverse. Two where
        the name is `base2end` or `base_to_end`: as OpenCV means it (points of base to points of end), then as tf does
        (the pose of end in base). opencv : the name is one of OpenCV's own.
    """

    side: Side | None
    frames: tuple[Frame, ...] = ()
    weak: bool = False
    opencv: bool = False


def relation_of(path: str) -> Relation | None:
    """What a path of names (parts between dots or slashes) says; None for nothing."""
    path = "".join(one for one in unicodedata.normalize("NFD", path) if not unicodedata.combining(one))
    path = re.sub(r"(?<=[\u3040-\u9fff])(?=[A-Za-z0-9])", "_", path)
    path = _BEHIND.sub(lambda two: SPELT.get(two[0][1:].replace("_", "").lower(), two[0]), path)
    path = _OF_TWO.sub(lambda two: f"{two[2]}_to_{two[1]}", path)
    path = _LETTERS.sub(lambda letters: LETTERS.get(letters[1] + letters[2], letters[0]), path)
    parts = re.split(r"[./]", re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", "_", path))
    for part in reversed(parts):
        if (relation := _of_part(part)) is not None:
            return relation
    return Relation("camera", weak=True) if any(DETECTOR_WORDS & {*_words(part)} for part in parts) else None


def _words(part: str) -> list[str]:
    """The words of a part; `gripper2base` is three."""
    words = []
    for one in re.split(r"[\W_]+", part.lower()):
        word = one if one == "tool0" else re.sub(r"(?<=[a-z])\d+$", "", one)
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
        connected = any(word in CONNECTORS for word in words) or "hand eye" in " ".join(words)
        return Relation(None) if connected else Relation(SIDES[frames[0][1]])
    (first, a), (last, b) = frames[0], frames[-1]
    connector = next((word for word in words[first + 1 : last] if word in CONNECTORS), None)
    if connector is None or a == b:
        return Relation(sides.pop())
    inner, outer = (b, a) if CONNECTORS[connector] else (a, b)
    inverted = (inner, outer) in (("base", "flange"), ("camera", "target"))
    senses: tuple[Frame, ...] = ("flange_T_base", "base_T_flange") if inverted else ("base_T_flange", "flange_T_base")
    opencv = OPENCV.search(part) is not None
    return Relation(sides.pop(), senses[: 2 if connector in ("2", "to") and not opencv else 1], opencv=opencv)


def build_by_sides(names: Sequence[str], shared: Sequence[int], build: Callable[[list[int]], PoseTable]) -> PoseTable:
    """What `build` makes of the indices of the names: of the robot's, with the camera's beside it, where both are
    named and are poses; else of all of them. `shared`: indices that belong to both, such as a picture's name.

    Where only one side is named, names that say nothing are the other's if they can be: a detector's are the camera's.
    """
    relations = [relation_of(name) for name in names]
    named = {one.side for one in relations if one is not None and not one.weak}
    indices: dict[Side | None, list[int]] = {"robot": [], "camera": [], None: []}
    for index, one in enumerate(relations):
        if index not in shared and (one is None or one.side is not None):  # without X itself
            indices[None if one is None or (one.weak and "robot" not in named) else one.side].append(index)
    nobodys, every = indices[None], [*range(len(names))]
    if not indices["robot"] and not indices["camera"]:  # a detector's pose beside one of no name: the robot's
        indices["camera"] = [index for index in nobodys if relations[index] is not None]
        nobodys = sorted({*nobodys} - {*indices["camera"]})

    def table_of(at: list[int], side: Side | None) -> PoseTable | None:
        said = next((one for index in at if (one := relations[index]) is not None), None)
        try:
            built = with_relation(build([*at, *shared]), said)
        except DocumentError as error:
            if error.problems[0].place.startswith("pose "):  # a pose, and damaged
                raise
            return None
        return replace(built, side=side or built.side)

    robot, camera = (table_of(indices[side], side) if indices[side] else None for side in ("robot", "camera"))
    if camera is not None and robot is None:
        robot = table_of([at for at in nobodys if relations[at] is None or relations[at].weak], "robot")  # type: ignore[union-attr]
    if robot is not None and camera is not None:
        return replace(robot, camera=camera)
    if robot is not None:
        whole = build([*indices["robot"], *nobodys, *shared]) if nobodys else robot
        return replace(whole, side="robot", named_frames=robot.named_frames, opencv=robot.opencv)
    if camera is not None and named:
        return camera
    return build(every) if named else with_relation(build(every), next(filter(None, relations), None))


def with_relation(table: PoseTable, said: Relation | None) -> PoseTable:
    """The table with the side and the direction that a name says."""
    if said is None:
        return table
    named = {"named_frames": said.frames, "opencv": said.opencv} if said.frames and not table.named_frames else {}
    return replace(table, side=said.side or table.side, **named)  # type: ignore[arg-type]


def angles_of(table: PoseTable, conventions: Sequence[Convention]) -> list[tuple[Convention, Array]]:
    """The angles (n, n) between the poses of a table in each convention that makes them rotations."""
    found, few = [], table.take(range(min(len(table), MAX_COMPARED)))
    for convention in conventions:
        with suppress(GeometryError):
            found.append((convention, angles_between(few.poses(convention, "mm", "base_T_flange")[:, :3, :3])))
    return found


def agreeing_conventions(
    robot: PoseTable, camera: PoseTable, of_robot: Sequence[Convention], of_camera: Sequence[Convention]
) -> tuple[float, tuple[Convention, ...], tuple[Convention, ...]]:
    """The least mismatch (rad) of the angles, and the conventions of both sides that leave about as little."""
    ours, seen = angles_of(robot, of_robot), angles_of(camera, of_camera)
    compared = [(mean_mismatch_rad(mine, its), one, other) for one, mine in ours for other, its in seen]
    least = min((mismatch for mismatch, _, _ in compared), default=np.inf)
    near = [(one, other) for mismatch, one, other in compared if mismatch <= least + MORE_MISMATCH_RAD]
    robots, cameras = (tuple(dict.fromkeys(pair[at] for pair in near)) for at in (0, 1))
    return least, robots, cameras


def best_split(splits: Iterable[tuple[PoseTable, PoseTable]]) -> PoseTable | None:
    """The robot's table with the camera's beside it, of the split whose sides turn alike; None where none does."""
    best, found = MAX_MISMATCH_RAD, None
    for robot, camera in splits:
        conventions = [one.conventions() for one in (robot, camera)]
        mismatch = agreeing_conventions(robot, camera, *conventions)[0]
        if mismatch < best:
            note = "no name says whose the poses are: that follows from what the flange carries, which is near to it"
            best, found = mismatch, replace(robot, camera=camera, side=None, notes=(*robot.notes, note))
    return found


def rows_as_pairs(table: PoseTable) -> PoseTable | None:
    """A table whose rows are the robot's and the camera's poses in turn, or all of one side, then of the other."""
    n, steps = len(table) // 2, np.linalg.norm(np.diff(table.lengths, axis=0), axis=1)
    is_path = np.median(steps) < MAX_STEP_SHARE * np.linalg.norm(np.ptp(table.lengths, axis=0))
    if len(table) % 2 or n < MIN_PAIRS or is_path:
        return None
    halves = ((range(0, 2 * n, 2), range(1, 2 * n, 2)), (range(n), range(n, 2 * n)))
    return best_split((table.take(one), table.take(other)) for one, other in halves)


def equal_sides(robot: PoseTable, camera: PoseTable) -> bool:
    """Whether both sides hold the same numbers."""
    if robot.kind != camera.kind or len(robot) != len(camera):
        return False
    pairs = ((robot.lengths, camera.lengths), (robot.numbers, camera.numbers))
    return all(np.allclose(mine, its, rtol=1e-6, atol=1e-9) for mine, its in pairs)


def choose_frame(origin: str, names: Sequence[str], columns: Sequence[Sequence[Any]], build: Build) -> PoseTable:
    """What `build` makes of the columns without those of other frames and of commanded poses. Raises DocumentError."""

    def poses_in(own: Sequence[int], called: Sequence[str] = names) -> PoseTable | None:
        with suppress(DocumentError):
            table = build(own, called) if sum(np.size(columns[at][0]) for at in own) >= 6 else None
            return table if table and table.kind not in ("joints", "points") else None
        return None

    frames: dict[str, list[int]] = {}
    for at, name in enumerate(names):
        commanded = _COMMANDED.search(name) and any(one.lower().startswith("actual") for one in names)
        frames.setdefault("beside" if commanded else _frame_of(name), []).append(at)
    beside = frames.pop("beside", [])
    found = {frame: one for frame, own in frames.items() if frame and (one := poses_in(own))}
    poses = {frame: found[frame] for frame in sorted(found, key=lambda one: one != "flange") if found[frame].moves}
    beside += [at for frame in found if frame not in poses for at in frames[frame]]
    if len(found) > 1:
        with suppress(DocumentError):
            if (table := build(range(len(names)), names)).parts:  # a snapshot of tf, of which the user names a frame
                return table
    taken, *others = poses or ("",)
    if taken != "flange" and not all(equal_sides(poses[taken], poses[one]) for one in others):
        what = f"poses of {' and of '.join(poses)}, and no name says which are the flange's"
        raise refusal(origin, "names", what, "keep only those, or call them flange")
    left = {at for one in others for at in frames[one]} | {*(beside if poses else ())}
    kept = [at for at in range(len(names)) if at not in left]
    table = build(kept, names)
    used = [names[at] for at in kept if np.size(columns[at][0]) > 2 or names[at] in table.layout]
    tool = next((said[0] for name in used if _frame_of(name) and (said := _TOOL.search(name))), None)
    if tool is not None and table.kind not in ("joints", "points") and not table.parts:
        of_tool = [at for at in beside if _OFFSET.search(names[at])]
        offset = poses_in(of_tool, [_OFFSET.sub("tcp", name) for name in names])
        table = apply_offset(table, tool, offset, names[of_tool[0]] if of_tool else "")
        beside = beside if table.offsets is None else [at for at in beside if at not in of_tool]
    notes = (f"the poses of {taken} are taken, not those of {', '.join(others)}",) * bool(others)
    notes += (f"not used: {', '.join(names[at] for at in beside)}",) * bool(poses and beside)
    return replace(table, notes=(*table.notes, *notes))


def apply_offset(table: PoseTable, tool: str, offset: PoseTable | None, name: str) -> PoseTable:
    """The flange's poses of a tool's and of its offset, called `name`; without one that fits, the tool's as such."""
    if offset is None or not table.may_be_offset(offset):
        return replace(table, poses_of=PosesOf(tool))
    note = f"the flange's poses are those of {tool} and its offset {name}"
    return replace(table, offsets=np.hstack([offset.lengths, offset.numbers]), notes=(*table.notes, note))


def _frame_of(name: str) -> str:
    """flange, beside, the word of another frame that moves, or of the robot; "" for what is not the robot's."""
    relation = relation_of(name)
    if relation is None or relation.side != "robot":
        return ""
    words = [word for part in re.split(r"[./]", name) for word in _words(part)]
    said = [word for word in words if SIDES.get(WORD_FRAMES.get(word, "")) == "robot"]
    moving = [word for word in said if WORD_FRAMES[word] == "flange"]
    is_flange = not {*words}.isdisjoint(WORDS["of_flange"].split())
    return "beside" if _BESIDE.search(name) else "flange" if is_flange else ["robot", *said[:1], *moving][-1]
