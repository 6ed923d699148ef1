"""ros-industrial/industrial_calibration: cal_data.yaml with a pose file and an image for each view.

Source: docs/page_extrinsic_hand_eye_calibration.dox: positions in metres, quaternions qx, qy, qz, qw.
"""

from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from calibration.documents.imports.intrinsics import intrinsics_of
from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.pose_table import concatenate
from calibration.documents.imports.records import number_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import Files, ImportedSet
from calibration.documents.imports.trees import read_yaml

CONFIGURATION = "cal_data.yaml"
DICTIONARIES = (
    *(f"DICT_{bits}X{bits}_{count}" for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000)),
    "DICT_ARUCO_ORIGINAL",
)
"""OpenCV's predefined dictionaries by their number."""


def recognise(files: Files) -> bool:
    """Whether there is a cal_data.yaml."""
    return CONFIGURATION in files.names


def read(files: Files, part: str | None) -> ImportedSet:
    """The set. Raises DocumentError."""
    data = read_yaml(files.read(CONFIGURATION), CONFIGURATION)
    views = data.get("data") if isinstance(data, dict) else None
    if not isinstance(views, list) or not all(
        isinstance(view, dict) and {"pose", "image"} <= set(view) for view in views
    ):
        fix = "give a list of mappings with pose and image"
        raise refusal(CONFIGURATION, "data", "no list of poses and images", fix, "industrial_calibration")
    names = [str(view["pose"]) for view in views]
    tables = [read_poses(name, files.read(name)) for name in names]
    poses = concatenate(tables, [PurePosixPath(name).stem for name in names], CONFIGURATION)
    finder = data.get("target_finder")
    static = data.get("static_camera")
    return ImportedSet(
        "industrial_calibration",
        replace(poses, unit="m", frame="base_T_flange"),
        tuple(str(view["image"]) for view in views),
        f"by {CONFIGURATION}",
        target=target_of(finder) if isinstance(finder, dict) else None,
        camera=intrinsics_of(data["intrinsics"], CONFIGURATION) if isinstance(data.get("intrinsics"), dict) else None,
        setup=None if static is None else "eye-to-hand" if static else "eye-in-hand",
    )


def target_of(finder: dict[str, Any]) -> dict[str, Any] | None:
    """The target of a target_finder, lengths in m; None for a kind that is not known."""
    plain = {str(key): value for key, value in finder.items()}
    size = {"columns": plain.get("cols"), "rows": plain.get("rows")}
    dictionary = number_of(plain.get("dictionary"))
    name = DICTIONARIES[int(dictionary)] if dictionary is not None and 0 <= dictionary < len(DICTIONARIES) else None
    match str(plain.get("type")):
        case "ModifiedCircleGridTargetFinder":
            return {"kind": "circles", "layout": "symmetric", **size, "pitch_mm": _mm(plain.get("spacing")),
                    "origin": "large-dot"}  # fmt: skip
        case "CharucoGridTargetFinder":
            return {"kind": "charuco", **size, "square_mm": _mm(plain.get("chessboard_dim")),
                    "marker_mm": _mm(plain.get("aruco_marker_dim")), "dictionary": name}  # fmt: skip
        case "ArucoGridTargetFinder":
            return {"kind": "aruco-grid", **size, "marker_mm": _mm(plain.get("aruco_marker_dim")),
                    "gap_mm": _mm(plain.get("marker_gap")), "dictionary": name}  # fmt: skip
    return None


def _mm(metres: Any) -> float | None:
    number = number_of(metres)
    return None if number is None else round(1000 * number, 9)
