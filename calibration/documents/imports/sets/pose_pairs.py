"""Pairs of a robot's pose and a tracker's: samples of easy_handeye, easy_handeye2 and moveit_calibration.

Sources: easy_handeye2_msgs/msg/SampleList.msg and handeye_sampler.py, which records the effector in the base for
eye_in_hand and the base in the effector for eye_on_base; handeye_control_widget.cpp of moveit_calibration, whose
samples are effector_wrt_world and object_wrt_sensor, 16 numbers row by row. All in metres.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.records import array_of, table_of_array, table_of_data
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import Files, ImportedSet, of_suffix
from calibration.documents.imports.trees import read_json, read_yaml
from calibration.errors import DocumentError
from calibration.problem import Setup

TEXTS = frozenset((".samples", ".yaml", ".yml", ".json"))
ROBOT_KEYS = ("robot", "effector_wrt_world", "hand_world_samples", "base_T_flange")
CAMERA_KEYS = ("tracking", "optical", "object_wrt_sensor", "camera_marker_samples", "camera_T_target")
SETUPS: dict[str, Setup] = {"eye_in_hand": "eye-in-hand", "eye_on_base": "eye-to-hand", "eye_to_hand": "eye-to-hand"}
MAX_TEXTS = 20
"""Files of a folder that are looked at; pictures lie beside one or two of them."""


def recognise(files: Files) -> bool:
    """Whether a text of the folder holds samples of pose pairs."""
    return any(True for _ in _samples(files))


def read(files: Files, part: str | None) -> ImportedSet:
    """The first samples of the folder. Raises DocumentError."""
    name, data = next(_samples(files))
    pairs = array_of_pairs(data) if isinstance(data, list) else None
    robot, seen = pairs or _by_keys(data, name)
    setup, inverted = _setup(data)
    return ImportedSet(
        "samples of pose pairs",
        replace(robot, origin=name, unit=robot.unit or "m", frame="flange_T_base" if inverted else "base_T_flange"),
        pairing=f"by {name}",
        camera_poses=replace(seen, origin=name, unit=seen.unit or "m"),
        setup=setup,
    )


def _samples(files: Files) -> Iterator[tuple[str, Any]]:
    for name in of_suffix(files.names, TEXTS)[:MAX_TEXTS]:
        try:
            content = files.read(name)
            data = read_json(content, name) if name.endswith(".json") else read_yaml(content, name)
        except DocumentError:
            continue
        if is_samples(data):
            yield name, data


def is_samples(data: Any) -> bool:
    """Whether data are samples: records with a robot's and a camera's pose, or pairs of matrices."""
    if isinstance(data, list) and data and isinstance(data[0], list):
        return array_of_pairs(data) is not None
    records = _listed(data)
    if not isinstance(records, list) or not records:
        return False
    return all(isinstance(one, dict) and _key(one, ROBOT_KEYS) and _key(one, CAMERA_KEYS) for one in records)


def array_of_pairs(data: list[Any]) -> tuple[PoseTable, PoseTable] | None:
    """The tables of a list of pairs of 4 x 4 matrices; None for anything else."""
    if not data or not all(isinstance(pair, list) and len(pair) == 2 for pair in data):
        return None
    robot, seen = (array_of([pair[at] for pair in data]) for at in (0, 1))
    if robot is None or seen is None or robot.shape[1:] != (4, 4) or seen.shape[1:] != (4, 4):
        return None
    return table_of_array(robot, "robot"), table_of_array(seen, "camera")


def _listed(data: Any) -> Any:
    if isinstance(data, dict):
        if isinstance(data.get("hand_world_samples"), dict | list):
            robot, seen = (_transforms(data.get(key)) for key in ("hand_world_samples", "camera_marker_samples"))
            if len(robot) == len(seen):
                return [{"robot": one, "tracking": other} for one, other in zip(robot, seen, strict=True)]
        return data.get("samples", data.get("transforms", data.get("views")))
    return data


def _transforms(data: Any) -> list[Any]:
    found = data.get("transforms", []) if isinstance(data, dict) else data
    return found if isinstance(found, list) else []


def _key(record: dict[Any, Any], keys: tuple[str, ...]) -> str | None:
    return next((key for key in keys if key in record), None)


def _by_keys(data: Any, origin: str) -> tuple[PoseTable, PoseTable]:
    records, tables = _listed(data), []
    for keys in (ROBOT_KEYS, CAMERA_KEYS):
        key = _key(records[0], keys) or ""
        if any(key not in record for record in records):
            raise refusal(origin, key, "missing in a sample", "give every sample both poses", "pose-pairs")
        tables.append(table_of_data([_transform(record[key]) for record in records], f"{origin}: {key}"))
    return tables[0], tables[1]


def _transform(value: Any) -> Any:
    """The geometry_msgs/Transform of a stamped one."""
    return value["transform"] if isinstance(value, dict) and "transform" in value else value


def _setup(data: Any) -> tuple[Setup | None, bool]:
    """The set-up that easy_handeye's parameters or session.json state; the first inverts its poses in eye-to-hand."""
    if not isinstance(data, dict):
        return None, False
    parameters = data.get("parameters")
    if not isinstance(parameters, dict):
        return SETUPS.get(str(data.get("setup")).replace("-", "_")), False
    if "eye_on_hand" in parameters:
        setup: Setup | None = "eye-in-hand" if parameters["eye_on_hand"] else "eye-to-hand"
    else:
        setup = SETUPS.get(str(parameters.get("calibration_type")))
    return setup, setup == "eye-to-hand"
