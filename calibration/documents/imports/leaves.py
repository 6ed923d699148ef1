"""Poses in plain data of JSON, YAML, XML or numpy: records, or arrays over the views, as named leaves.

A leaf is what a path of names leads to in every record: a number, a text, or an array. What a leaf can be follows from
its shape first (4 x 4 a pose, 3 x 3 with three numbers a pose, six or seven numbers one), then from its names. Arrays
over the views (`R_gripper2base` of n x 3 x 3), numbered names (`pose1`, `pose2`) and mappings are records as well.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calibration.documents.imports.number_tables import (
    JOINT_WORDS,
    TURN_WORDS,
    are_rotations,
    table_of_joints,
    table_of_one_side,
    table_of_rows,
    table_of_sides,
    text_columns,
    with_names,
    words_of,
)
from calibration.documents.imports.pairing import natural
from calibration.documents.imports.pose_table import PoseTable, table_of_arrays, table_of_matrices
from calibration.documents.imports.refusal import MAX_POSES, refusal
from calibration.documents.imports.sides import WORDS, relation_of
from calibration.kinematics.conventions import CONVENTIONS
from calibration.problem import PosesOf, Setup
from calibration.transforms import Array

MAX_DEPTH = 8
MIN_PICTURE = 1000  # bytes of an array that is a picture
DEPTH = frozenset(WORDS["of_depth"].split())
"""Words of pictures beside a camera's own; so is a TIFF called as another picture is."""

MAX_CELLS = 200  # numbers of one record; a pose has 16 at most, a record may have joints and measurements besides
MAX_TEXT, NO_AXIS = 1000, 8.9e9  # characters of a text that is read as numbers; RAPID's 9E9 is greater
MATRICES = ((4, 4), (3, 4), (16,))
ROWS = ((6,), (7,), (12,))
TURNS = ((3, 3), (9,))
SAVEZ: dict[Any, str] = {(3,): "position", (4,): "quaternion"}
"""Names of what one view has of arrays that np.savez called arr_0, arr_1."""

ONE_VIEW = (*MATRICES, *ROWS, *TURNS, (3,), (4,), ())  # shapes of what one view has; other arrays are over the views

Leaf = Array | np.float64 | str
Leaves = Iterator[tuple[str, Leaf]]
_NUMBERED = re.compile(r"(\D.*?)[_\- ]?(\d+)")
_NUMBER_WITHIN = re.compile(r"(\D+?)(\d+)(_.+)")  # frame0_robot_R


def number_of(value: Any) -> float | None:
    """A number, also one written as text (YAML reads 1e-08 as text); None for anything else, as 20260131_181810."""
    if isinstance(value, bool) or not isinstance(value, int | float | str) or "_" in str(value):
        return None
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None


def array_of(value: Any) -> Array | None:
    """The array of nested lists of numbers of one length each; None for anything else."""
    if isinstance(value, np.ndarray):
        return value
    if not isinstance(value, list) or not value or len(value) > MAX_POSES:
        return None
    rows = []
    for item in value:
        inner: Any = array_of(item) if isinstance(item, list | np.ndarray) else number_of(item)
        if inner is None:
            return None
        rows.append(inner)
    return None if len({np.shape(row) for row in rows}) != 1 or np.ndim(rows[0]) > 3 else np.array(rows, float)


def is_picture(value: Any) -> bool:
    """Whether it is an array of a picture's bytes, (h, w) or (h, w, 3), or of several: (n, h, w) or (n, h, w, 3)."""
    return isinstance(value, np.ndarray) and value.dtype == np.uint8 and value.ndim > 1 and value.size >= MIN_PICTURE


def table_beside_pictures(data: Any, origin: str) -> PoseTable:
    """The table of plain data, with the picture of each pose where the data hold them. Raises DocumentError."""
    held = {name: one for name, one in data.items() if is_picture(one)} if isinstance(data, dict) else {}
    table = table_of_data({name: one for name, one in data.items() if name not in held} if held else data, origin)
    own = [
        one if len(one) == len(table) else one[None] for name, one in held.items() if DEPTH.isdisjoint(words_of(name))
    ]
    fitting = [tuple(one) for one in own if len(one) == len(table)]
    return replace(table, pictures=fitting[0] if len(fitting) == 1 else ())


def table_of_data(data: Any, origin: str) -> PoseTable:
    """The table of plain data, with the camera's poses where they hold both sides. Raises DocumentError."""
    data = _opencv_matrix(data)
    if (array := array_of(data)) is not None:
        return table_of_array(array, origin)
    if isinstance(data, dict) and "frameCount" in data:  # handeye_calib_camodocal: base_T_tip and camera_T_tag
        data = {str(key).replace("T1_", "robot_").replace("T2_", "camera_"): value for key, value in data.items()}
    records, labels = _records(data, origin)
    if len(records) > MAX_POSES:
        raise refusal(origin, "records", f"{len(records)}, where {MAX_POSES} are read", "give those of the pictures")
    if labels is None and (array := array_of(records)) is not None:
        return table_of_array(array, origin)
    flat = [dict(_leaves(record, origin)) for record in records]
    every = {name: leaf for record in flat for name, leaf in record.items()}
    usual = [name for name in every if 2 * sum(name in record for record in flat) > len(flat)]
    flat = [{name: record.get(name, np.full(np.shape(every[name]), np.nan)) for name in usual} for record in flat]
    names = [name for name in usual if len({np.shape(one[name]) for one in flat}) == 1]
    if not names:
        raise refusal(origin, "records", "they have no key in common", "give every pose the same keys")
    built = table_of_sides(origin, names, [[record[name] for record in flat] for name in names], _table_of_leaves)
    target = data["target"] if isinstance(data, dict) and isinstance(data.get("target"), dict) else None
    units = {record.get("unit") for record in records if isinstance(record, dict) and "cloud" in record}
    unit = units.pop() if units in ({"m"}, {"mm"}) else None
    own = data["poses_of"] if isinstance(data, dict) and isinstance(data.get("poses_of"), dict) else {}
    of = PosesOf(*(str(own.get(name) or "") for name in ("tool", "base"))) if own else built.poses_of
    table = replace(built, setup=setup_of(data), target=target, cloud_unit=unit, poses_of=of)
    table = _as_recorded(table, data, names)
    if (called := tuple(labels or ())) and len({*called}) == len(called) == len(table):
        return replace(table, labels=called, camera=table.camera and replace(table.camera, labels=called))
    return table


RECORDERS = tuple({*pair.split()} for pair in WORDS["recorders"])
"""How easy_handeye, easy_handeye2, moveit_calibration and visp_hand2eye_calibration call both poses, in metres.
Sources: easy_handeye2_msgs/msg/SampleList.msg and handeye_sampler.py, which records the effector in the base for
eye_in_hand and the base in the effector for eye_on_base; moveit_calibration's handeye_control_widget.cpp (rad)."""


def _as_recorded(table: PoseTable, data: Any, names: Sequence[str]) -> PoseTable:
    """The table with what the recorder is known to write."""
    if isinstance(data, dict) and {"joint_names", "joint_values"} <= set(data) and table.kind == "joints":
        order = sorted(range(6), key=lambda at: natural(str(data["joint_names"][at])))
        return replace(table, numbers=table.numbers[:, order], convention=CONVENTIONS["joints-rad"])
    words = {part for name in names for part in name.split(".")} | ({*data} if isinstance(data, dict) else set())
    if table.camera is None or not any(pair <= words for pair in RECORDERS):
        return table
    in_effector = table.setup == "eye-to-hand" and "parameters" in words
    return replace(
        table, unit=table.unit or "m", frame="flange_T_base" if in_effector else "base_T_flange",
        camera=replace(table.camera, unit=table.camera.unit or "m"),
    )  # fmt: skip


SETUPS: dict[str, Setup] = {"eye_in_hand": "eye-in-hand", "eye_on_base": "eye-to-hand", "eye_to_hand": "eye-to-hand"}


def setup_of(data: Any) -> Setup | None:
    """The set-up that a session.json or the parameters of easy_handeye state."""
    stated = data.get("parameters", data) if isinstance(data, dict) else None
    if not isinstance(stated, dict):
        return None
    if "eye_on_hand" in stated:
        return "eye-in-hand" if stated["eye_on_hand"] else "eye-to-hand"
    return SETUPS.get(str(stated.get("calibration_type", stated.get("setup"))).replace("-", "_"))


def _table_of_leaves(origin: str, named: Sequence[str], columns: Sequence[Sequence[Leaf]]) -> PoseTable:
    """The table of the leaves of one side: by their shapes where one of them is a pose, else by their names."""
    leaves = dict(zip(named, columns, strict=True))
    if len(frames := _moving_frames(leaves)) > 1:
        parts = {name: _table_of_leaves(origin, [*own], [*own.values()]) for name, own in frames.items()}
        return replace(next(iter(parts.values())), parts=parts)
    leaves = next(iter(frames.values()), leaves)
    kinds = {name: np.shape(column[0]) for name, column in leaves.items()}  # () of a number or a text
    matrices, rows, turns, places, texts = (
        [name for name, kind in kinds.items() if kind in wanted]
        for wanted in ((*MATRICES, (2, 4, 4)), ROWS, TURNS, ((3,),), ((),))
    )
    rows = [name for name in rows if not np.any(np.array(leaves[name]) > NO_AXIS)]  # 9E9: axes that are not there
    rows = [name for name in rows if not set(words_of(name)) & JOINT_WORDS] or ([] if places else rows)
    turns = [name for name in turns if are_rotations(np.array(leaves[name], float).reshape(-1, 3, 3))]
    if not leaves:
        raise refusal(origin, "records", "no numbers of a pose", "name them")
    cells = {name: [leaf if isinstance(leaf, str) else float(leaf) for leaf in leaves[name]] for name in texts}
    whole: PoseTable | None = None
    if len(matrices) == 1:
        whole = table_of_array(np.array(leaves[matrices[0]]), origin)
    elif not matrices and len(turns) == len(places) == 1:
        place, turn = (np.array(leaves[name]) for name in (places[0], turns[0]))
        whole = table_of_arrays(origin, (), place, turn.reshape(-1, 9), f"{turns[0]} and {places[0]}", "matrix")
    elif not matrices and not turns and len(rows) == 1:
        listed = np.array(leaves[rows[0]])
        joints = listed.shape[1] == 6 and set(words_of(rows[0])) & JOINT_WORDS
        whole = table_of_joints(origin, (), listed, rows[0]) if joints else table_of_array(listed, origin)
    elif len(matrices) > 1:
        what = f"{len(matrices)} poses in a record ({', '.join(matrices[:4])}), and their names do not say whose"
        raise refusal(origin, "records", what, "name them robot and camera, or gripper2base and target2cam")
    if whole is not None:
        return with_names(whole, text_columns(texts), texts, [*cells.values()])
    flat: dict[str, list[Any]] = {}
    for name, column in leaves.items():
        if name in cells:
            flat[name] = cells[name]
            continue
        stem = SAVEZ.get(kinds[name], name) if name.startswith("arr_") else name
        grid = kinds[name] == (3, 3) and (len(turns) == 1 or set(words_of(name)) & TURN_WORDS)
        for at, numbers in enumerate(np.array(column, float).reshape(len(column), -1).T.tolist()):
            flat[f"{stem}.r{at // 3}{at % 3}" if grid else f"{stem}.{at}"] = numbers
    return table_of_one_side(origin, [*flat], [*flat.values()])


def _moving_frames(leaves: dict[str, Sequence[Leaf]]) -> dict[str, dict[str, Sequence[Leaf]]]:
    """The leaves of each moving frame by its name, where a record has a place and a quaternion of three frames or more,
    as a snapshot of tf has; else {}. What belongs to no frame, such as a picture's name, is among those of each."""
    stems = dict.fromkeys(name.rpartition(".")[0] for name in leaves if "." in name)
    within = {stem: [name for name in leaves if name.startswith(f"{stem}.")] for stem in stems}
    motions = {}
    for stem, names in within.items():
        numbers = [np.array(leaves[name]) for name in names if np.shape(leaves[name][0])]
        if sorted(one.shape[1:] for one in numbers) == [(3,), (4,)]:
            motions[stem] = float(np.ptp(np.hstack(numbers), axis=0).max())
    if len(motions) < MIN_FRAMES:
        return {}
    own = {name for stem in motions for name in within[stem]}
    moving = [stem for stem, motion in motions.items() if motion > STILL_SHARE * max(motions.values())]
    return {
        stem.rpartition(".")[2]: {name: one for name, one in leaves.items() if name in within[stem] or name not in own}
        for stem in moving
    }


MIN_FRAMES, STILL_SHARE = 3, 0.02
"""Poses of a record that are those of frames; and the motion of one that stands, as a share of the greatest."""


def table_of_array(array: Array, origin: str, labels: Sequence[str] = ()) -> PoseTable:
    """The table of an array: (n, 3 or 4, 4), (3 or 4, 4), (n, k), (k,) or a column (k, 1). Raises DocumentError.

    (n, 2, 4, 4), (2, n, 4, 4) and (n, 2, k) are pairs: of the robot's pose and the camera's.
    """
    if array.ndim == 4 and len(array) == 2:
        array = np.swapaxes(array, 0, 1)
    if array.ndim in (2, 3) and array.shape[-1] == 1:
        array = array[..., 0]
    if array.ndim == 1 or array.shape in ((4, 4), (3, 4)):
        array = array[None]
    if array.ndim in (3, 4) and array.shape[1] == 2 and array.shape[2:] in (*MATRICES, *ROWS):
        robot, camera = (table_of_array(array[:, at], origin, labels) for at in (0, 1))
        return replace(robot, side=None, camera=camera, frame="base_T_flange")
    if array.ndim == 3 and array.shape[1:] in ((4, 4), (3, 4)):
        return table_of_matrices(origin, labels, array, f"{array.shape[1]} x 4 matrices")
    if array.ndim != 2 or not array.size:
        shape = " x ".join(map(str, array.shape))
        raise refusal(origin, "array", f"its shape {shape} is none of poses", "give n x 4 x 4, n x 7 or n x 6")
    return table_of_rows(origin, array, labels or [str(at + 1) for at in range(len(array))])


def _opencv_matrix(data: Any) -> Any:
    """OpenCV's and ViSP's {rows, cols, data}, Zivid's {FloatMatrix: {Data: ...}} and a text of numbers as a list."""
    if isinstance(data, str):
        numbers = [number_of(one) for one in re.findall(r"[^][(),;\s]+", data[:MAX_TEXT])]
        return data if (len(numbers),) not in ((3,), (4,), *ROWS, *MATRICES, *TURNS) or None in numbers else numbers
    if isinstance(data, dict):
        if isinstance(data.get("FloatMatrix"), dict):
            return data["FloatMatrix"].get("Data")
        if {"rows", "cols", "data"} <= set(data) and isinstance(data["data"], list):
            rows, cols, numbers = number_of(data["rows"]), number_of(data["cols"]), data["data"]
            if rows and cols and len(numbers) == rows * cols and cols > 1:
                return [numbers[at : at + int(cols)] for at in range(0, len(numbers), int(cols))]
            return numbers
    return data


def _records(data: Any, origin: str) -> tuple[list[Any], list[str] | None]:
    """The records of the data: the list that holds most, or the values of a mapping; and the mapping's keys."""
    for _ in range(MAX_DEPTH):
        if isinstance(data, list):
            if data and all(isinstance(item, dict | list | np.ndarray) for item in data):
                return data, None
            break
        if not isinstance(data, dict) or not data:
            break
        data = {str(key): _opencv_matrix(value) for key, value in data.items()}
        if views := _arrays_over_views(data, origin) or _numbered_views(data, origin):
            return views
        values = list(data.values())
        if len(data) > 1 and _alike(data):
            return values, list(data)
        lists = [value for value in values if isinstance(value, list) and value and isinstance(value[0], dict | list)]
        lists = [one for one in lists if isinstance(one[0], dict)] or lists
        if (len(lists) == 1 and array_of(lists[0]) is None) or (lists and len(values) == 1):
            data = lists[0]
        elif len(values) == 1 and isinstance(values[0], dict):
            data = values[0]
        else:
            return [data], None
    what = "no list of poses, no mapping of poses and no pose"
    raise refusal(origin, "document", what, "give a list of records with x, y, z, qw, qx, qy, qz")


def _arrays_over_views(data: dict[str, Any], origin: str) -> tuple[list[Any], None] | None:
    """A record for each view, of arrays and lists that have an element for each; None where there are none."""
    leaves: dict[str, Any] = dict(_leaves(data, origin, most=MAX_POSES * 16))
    for name, value in data.items():  # records, also of one list below: {hand_world_samples: {transforms: [...]}}
        lists = [one for one in (value.values() if isinstance(value, dict) else [value]) if isinstance(one, list)]
        leaves |= {name: lists[0]} if len(lists) == 1 and lists[0] and isinstance(lists[0][0], dict) else {}
    every = {name: leaf for name, leaf in leaves.items() if isinstance(leaf, np.ndarray)}

    # Arrays with a column for each view: too long for one view, or with as many columns as there are rotations.
    turns = {len(leaf) for leaf in every.values() if leaf.shape[1:] == (3, 3)} - {3}
    rows_of_pose = {name: leaf for name, leaf in every.items() if leaf.ndim == 2 and len(leaf) in (3, 6, 7)}
    every |= {n: leaf.T for n, leaf in rows_of_pose.items() if leaf.size > 7 * 16 or leaf.shape[1] in turns}

    arrays = {name: leaf for name, leaf in every.items() if {leaf.shape, _squeeze(leaf).shape}.isdisjoint(ONE_VIEW)}
    sides = [relation_of(name) for name, leaf in every.items() if leaf.shape in MATRICES[:2]]
    seen_only = all(leaf.shape[1:] in ((2,), (3,)) for leaf in arrays.values() if leaf.ndim > 1)
    if seen_only and sum(one is not None and one.side == "robot" for one in sides) == 1:
        return [data], None  # a pose, and the corners or points that were seen from it

    counts = {name: len(leaf) for name, leaf in arrays.items() if leaf.size >= 3 * len(leaf)}
    counts |= {name: len(leaf) for name, leaf in leaves.items() if isinstance(leaf, list)}
    if len(counts) < 2 and arrays.keys().isdisjoint(counts):
        return None
    n = max(set(counts.values()), key=[*counts.values()].count)
    columns: dict[str, Any] = {name: leaf for name, leaf in data.items() if isinstance(leaf, list)}
    columns |= {k: v for k, v in leaves.items() if isinstance(v, np.ndarray) and v.shape not in MATRICES[:2]}
    columns |= {name: leaves[name] for name in counts}
    columns |= {name: leaf if leaf.shape[1:] in ROWS else _without_counters(leaf) for name, leaf in arrays.items()}
    columns = {name: leaf for name, leaf in columns.items() if len(leaf) == n}
    return [{name: _squeeze(leaf[at]) for name, leaf in columns.items()} for at in range(n)], None


def _numbered_views(data: dict[str, Any], origin: str) -> tuple[list[Any], list[str]] | None:
    """A record for each number that names have, {base2end1: ..., base2end2: ...} or {base2end: {1: ..., 2: ...}}."""
    numbered: dict[str, dict[str, Any]] = {
        name: views
        for name, views in data.items()
        if isinstance(views, dict)
        and len(views) > 1
        and len({re.sub(r"\d+", "", str(key)) for key in views}) == 1
        and all(isinstance(view, list | dict) for view in views.values())
    }
    for name, value in data.items():
        if (found := _NUMBERED.fullmatch(name) or _NUMBER_WITHIN.fullmatch(name)) and isinstance(value, list | dict):
            numbered.setdefault("".join(found.groups()[::2]), {})[found[2]] = value
    n = max(map(len, numbered.values()), default=0)
    if n < 2:
        return None
    full = {stem: views for stem, views in numbered.items() if len(views) == n}
    numbers = sorted(next(iter(full.values())), key=natural)
    if any(set(views) != set(numbers) for views in full.values()):
        what = f"the numbers behind {' and '.join(full)} differ"
        raise refusal(origin, "document", what, "give both poses for every picture")
    return [{stem: views[number] for stem, views in full.items()} for number in numbers], numbers


def _without_counters(rows: Array) -> Array:
    """Rows of more than three numbers without those in front that count them, or are one whole number in all."""
    while rows.ndim == 2 and rows.shape[1] > 3 and np.all(rows[:, 0] == np.round(rows[:, 0])):
        if not (np.ptp(rows[:, 0]) == 0 or np.all(np.diff(rows[:, 0]) == 1)):
            break
        rows = rows[:, 1:]
    return rows


def _squeeze(leaf: Any) -> Any:
    """A column (k, 1) or a row (1, k) as k numbers."""
    return np.ravel(leaf) if isinstance(leaf, np.ndarray) and leaf.ndim == 2 and 1 in leaf.shape else leaf


def _alike(data: dict[str, Any]) -> bool:
    """Whether all values are records with a key in common that are no vectors, or arrays of one shape of a pose.

    Names of both sides, or of X or joints beside a pose, are those of one view.
    """
    sides = {one.side for name in data if (one := relation_of(name)) is not None}
    if len(sides) > 1 or any("joint" in name.lower() for name in data):
        return False
    values = list(data.values())
    if all(isinstance(value, dict) for value in values):
        return bool(set.intersection(*(set(map(str, value)) for value in values))) and not any(
            set(map(str, value)) <= {"x", "y", "z", "w"} for value in values
        )
    shapes = {getattr(array_of(value), "shape", None) for value in values}
    return len(shapes) == 1 and shapes <= {*MATRICES, *ROWS}


def _leaves(data: Any, origin: str, name: str = "", depth: int = 0, most: int = MAX_CELLS) -> Leaves:
    """(dotted name, leaf) of a record: an array of at most so many numbers, a number or a text."""
    if depth > MAX_DEPTH:
        raise refusal(origin, name or "record", "it nests too deep", "write plain records")
    data = _opencv_matrix(data)
    if isinstance(data, dict | list | np.ndarray):
        array = None if isinstance(data, dict) else array_of(data)
        if array is not None:
            if array.size <= most:
                yield name, array if most > MAX_CELLS else _squeeze(array)
            return
        if len(data) > MAX_CELLS:
            return
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from _leaves(value, origin, f"{name}.{key}" if name else str(key), depth + 1, most)
    elif data is not None:
        number = number_of(data)
        yield name, np.float64(number) if number is not None else str(data)
