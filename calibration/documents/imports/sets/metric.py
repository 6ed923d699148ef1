"""METRIC, the sets of davidea97/Multi-Camera-Hand-Eye-Calibration: cameraN/image, cameraN/pose, CalibrationInfo.yaml.

Source: its README: poses are 4 x 4 of the flange in the base, in metres; calibration_setup 0 is eye-in-hand.
"""

from dataclasses import replace
from typing import Any

from calibration.documents.imports.intrinsics import read_intrinsics
from calibration.documents.imports.pairing import pair
from calibration.documents.imports.records import number_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import PICTURES, Files, ImportedSet, of_suffix, read_one_each
from calibration.documents.imports.trees import read_yaml

INFO, CAMERA = "CalibrationInfo.yaml", "intrinsic_pars_file.yaml"


def recognise(files: Files) -> bool:
    """Whether there is a CalibrationInfo.yaml."""
    return INFO in files.names


def read(files: Files, part: str | None) -> ImportedSet:
    """One camera of the set; `part` names its folder. Raises DocumentError."""
    data = read_yaml(files.read(INFO), INFO)
    info: dict[str, Any] = data if isinstance(data, dict) else {}
    cameras = tuple(dict.fromkeys(name.split("/")[0] for name in files.names if "/pose/" in name))
    camera = part or (cameras[0] if len(cameras) == 1 else None)
    if camera not in cameras:
        what = f"{len(cameras)} cameras ({', '.join(cameras[:6])})"
        raise refusal(files.origin, "--part", what, "name one: --part camera1", "metric")
    inside = [name for name in files.names if name.startswith(f"{camera}/")]
    poses = replace(
        read_one_each(files, [name for name in inside if "/pose/" in name]), unit="m", frame="base_T_flange"
    )
    paired = pair(of_suffix(inside, PICTURES), poses)
    lens = f"{camera}/{CAMERA}"
    return ImportedSet(
        "METRIC", poses.take(paired.rows), paired.images, paired.words, target=_target(info),
        camera=read_intrinsics(lens, files.read(lens)) if lens in inside else None,
        setup="eye-to-hand" if number_of(info.get("calibration_setup")) else "eye-in-hand",
    )  # fmt: skip


def _target(info: dict[str, Any]) -> dict[str, Any] | None:
    size = number_of(info.get("size"))
    if info.get("pattern_type") != "checkerboard" or size is None:
        return None
    columns, rows = info.get("number_of_columns"), info.get("number_of_rows")
    return {"kind": "chessboard", "columns": columns, "rows": rows, "pitch_mm": round(1000 * size, 9)}
