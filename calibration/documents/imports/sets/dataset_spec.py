"""vision-calibration: dataset_spec.json, which states every convention.

Source: VitalyVorobyev/calibration-rs, app/src/schemas/dataset_spec.json: intrinsic Euler angles, lengths of the target
in metres, poses by index or by a token of the file's name.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from calibration.documents.imports.conventions import CONVENTIONS
from calibration.documents.imports.number_tables import table_of_rows
from calibration.documents.imports.pairing import pair
from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.records import array_of, number_of, table_of_array
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import Files, ImportedSet, matching
from calibration.documents.imports.text_tables import read_named_columns
from calibration.documents.imports.trees import read_json, read_json_lines

SPEC = "dataset_spec.json"
ROTATIONS = {
    "quat_xyzw": "quaternion-xyzw", "quat_wxyz": "quaternion-wxyz", "axis_angle_rad": "rotation-vector",
    "euler_xyz_deg": "euler-XYZ", "euler_xyz_rad": "euler-XYZ-rad", "euler_zyx_deg": "euler-ZYX",
    "euler_zyx_rad": "euler-ZYX-rad", "matrix4x4_row_major": "matrix",
}  # fmt: skip


def recognise(files: Files) -> bool:
    """Whether there is a dataset_spec.json."""
    return SPEC in files.names


def read(files: Files, part: str | None) -> ImportedSet:
    """One camera of the set; `part` is its id. Raises DocumentError."""
    data = read_json(files.read(SPEC), SPEC)
    spec: dict[str, Any] = data if isinstance(data, dict) else {}
    cameras = {str(one.get("id")): one for one in spec.get("cameras") or [] if isinstance(one, dict)}
    chosen = part or (next(iter(cameras)) if len(cameras) == 1 else None)
    if chosen not in cameras:
        what = f"{len(cameras)} cameras ({', '.join(list(cameras)[:6])})"
        raise refusal(SPEC, "cameras", what, "name one: --part ID", "dataset_spec")
    poses = _poses(files, spec)
    images = _images(files, cameras[str(chosen)].get("images"))
    paired = pair(images, poses)  # a token's regular expression is not run: it may take for ever
    return ImportedSet(
        "dataset_spec", poses.take(paired.rows), paired.images, paired.words, target=_target(spec.get("target")),
    )  # fmt: skip


def _images(files: Files, images: Any) -> list[str]:
    if isinstance(images, dict) and isinstance(images.get("pattern"), str):
        return list(matching(files.names, images["pattern"]))
    listed = images.get("paths") if isinstance(images, dict) else images
    if isinstance(listed, str):
        return list(matching(files.names, listed))
    return [str(name) for name in listed or []]


def _poses(files: Files, spec: dict[str, Any]) -> PoseTable:
    source, stated = spec.get("robot_poses"), spec.get("pose_convention")
    if not isinstance(source, dict) or not isinstance(stated, dict):
        raise refusal(SPEC, "robot_poses", "no robot_poses with a pose_convention", "add both", "dataset_spec")
    rotation = ROTATIONS.get(str(stated.get("rotation_format")))
    if rotation is None or stated.get("translation_units") not in ("m", "mm"):
        what = f"rotation {stated.get('rotation_format')!r} in {stated.get('translation_units')!r}"
        raise refusal(SPEC, "pose_convention", what, f"one of {', '.join(ROTATIONS)} in m or mm", "dataset_spec")
    name = str(source.get("path"))
    table = _table(files, name, source)
    inverted = str(stated.get("transform")) in ("t_tcp_base", "t_tcp_world")
    if table.kind != CONVENTIONS[rotation].kind:
        what = f"the poses are {table.layout}, not {stated.get('rotation_format')}"
        raise refusal(SPEC, "pose_convention.rotation_format", what, "make them agree", "dataset_spec")
    return replace(
        table, convention=CONVENTIONS[rotation], by_axis=False, unit=stated["translation_units"],
        frame="flange_T_base" if inverted else "base_T_flange",
    ).checked()  # fmt: skip


def _table(files: Files, name: str, source: dict[str, Any]) -> PoseTable:
    content, columns, field = files.read(name), source.get("columns"), source.get("matrix_field")
    if isinstance(columns, dict):
        turn = [str(one) for one in columns.get("rotation") or []]
        wanted = turn if len(turn) == 16 else [str(columns.get(key)) for key in ("tx", "ty", "tz")] + turn
        return table_of_rows(name, _columns(content, name, wanted))
    if isinstance(field, str):
        records = read_json_lines(content, name) if name.endswith("l") else read_json(content, name)
        arrays = [array_of(one.get(field)) if isinstance(one, dict) else None for one in records]
        found = [array.reshape(4, 4) for array in arrays if array is not None and array.size == 16]
        if len(found) < len(arrays):
            raise refusal(name, field, "missing or no 4 x 4 matrix", "correct it", "dataset_spec")
        return table_of_array(np.array(found), name)
    return read_poses(name, content)


def _columns(content: bytes, name: str, wanted: list[str]) -> Any:
    if not name.endswith((".json", ".jsonl")):
        return read_named_columns(content, name, wanted)
    records = read_json_lines(content, name) if name.endswith("l") else read_json(content, name)
    rows = [[number_of(one.get(key)) for key in wanted] if isinstance(one, dict) else [None] for one in records]
    if any(number is None for row in rows for number in row):
        raise refusal(name, "records", f"not all have {', '.join(wanted)}", "correct columns", "dataset_spec")
    return np.array(rows, float)


def _target(target: Any) -> dict[str, Any] | None:
    if not isinstance(target, dict):
        return None
    size = {"columns": target.get("cols"), "rows": target.get("rows")}
    square, marker = (number_of(target.get(key)) for key in ("square_size_m", "marker_size_m"))
    if target.get("kind") == "chessboard" and square:
        return {"kind": "chessboard", **size, "pitch_mm": round(1000 * square, 9)}
    if target.get("kind") == "charuco" and square and marker:
        lengths = {"square_mm": round(1000 * square, 9), "marker_mm": round(1000 * marker, 9)}
        return {"kind": "charuco", **size, **lengths, "dictionary": target.get("dictionary")}
    return None
