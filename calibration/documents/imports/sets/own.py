"""session.json and scan.json of handeyed: a folder is imported again to change or check what it states of its poses."""

from dataclasses import replace
from typing import Any

from calibration.documents.imports.intrinsics import Intrinsics, intrinsics_of
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.records import table_of_data
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import Files, ImportedSet
from calibration.documents.imports.sets.pose_pairs import SETUPS
from calibration.documents.imports.trees import read_json

FILES = ("session.json", "scan.json")
SOLVED_AS_IT_IS = ("corners_px", "points_mm", "camera_T_target")


def recognise(files: Files) -> bool:
    """Whether there is a session.json or a scan.json with pictures or clouds."""
    return any(name in FILES for name in files.names)


def read(files: Files, part: str | None) -> ImportedSet:
    """The set, with what the file states. Raises DocumentError."""
    name = next(name for name in files.names if name in FILES)
    data = read_json(files.read(name), name)
    views = data.get("views") if isinstance(data, dict) else None
    if not isinstance(views, list) or not views or not all(isinstance(view, dict) for view in views):
        raise refusal(name, "views", "no list of views", "give one record for each view", name.replace(".", ""))
    for key in SOLVED_AS_IT_IS:
        if key in views[0]:
            raise refusal(
                files.origin, name, f"a session with {key}", f"run handeyed solve {files.origin}", "own-files"
            )
    images = tuple(str(view.get("image") or view.get("cloud")) for view in views)
    poses = table_of_data([view.get("base_T_flange") for view in views], name)
    units = {view.get("unit") for view in views}
    return ImportedSet(
        "handeyed", replace(_in_mm(poses), images=images, frame=poses.frame or "base_T_flange"), images,
        f"by {name}", target=data.get("target"), camera=_camera(data.get("camera"), name),
        setup=SETUPS.get(str(data.get("setup")).replace("-", "_")),
        cloud_unit=next(iter(units)) if len(units) == 1 and units <= {"m", "mm"} else None,
    )  # fmt: skip


def _in_mm(poses: PoseTable) -> PoseTable:
    return replace(poses, unit="mm") if "translation_mm" in poses.layout or len(poses.units()) > 1 else poses


def _camera(camera: Any, name: str) -> Intrinsics | None:
    return intrinsics_of(camera, name) if isinstance(camera, dict) else None
