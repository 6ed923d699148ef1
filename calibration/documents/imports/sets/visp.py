"""ViSP: *pose_rPe_N.yaml (vpPoseVector: metres and a rotation vector), images and the camera's XML.

Source: doc/tutorial/calibration/tutorial-calibration-extrinsic-eye-in-hand.dox: rPe is the end effector in the robot's
frame, cPo the target in the camera.
"""

import re
from dataclasses import replace

from calibration.documents.imports.conventions import CONVENTIONS
from calibration.documents.imports.intrinsics import Intrinsics, read_intrinsics
from calibration.documents.imports.pairing import pair
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.sets.imported import PICTURES, Files, ImportedSet, of_suffix, read_one_each
from calibration.errors import DocumentError

_ROBOT, _CAMERA = re.compile(r"rPe_?\d+\.ya?ml$"), re.compile(r"cPo_?\d+\.ya?ml$")


def recognise(files: Files) -> bool:
    """Whether there are poses rPe."""
    return any(_ROBOT.search(name) for name in files.names)


def read(files: Files, part: str | None) -> ImportedSet:
    """The set. Raises DocumentError."""
    poses = _poses(files, _ROBOT)
    seen = [name for name in files.names if _CAMERA.search(name)]
    pictures = of_suffix(files.names, PICTURES)
    if seen and not pictures:
        return ImportedSet("ViSP", poses, pairing="by number", camera_poses=_poses(files, _CAMERA))
    paired = pair(pictures, poses)
    return ImportedSet("ViSP", poses.take(paired.rows), paired.images, paired.words, camera=_camera(files))


def _poses(files: Files, pattern: re.Pattern[str]) -> PoseTable:
    table = read_one_each(files, [name for name in files.names if pattern.search(name)])
    return replace(table, convention=CONVENTIONS["rotation-vector"], unit="m", frame="base_T_flange")


def _camera(files: Files) -> Intrinsics | None:
    for name in files.names:
        if name.endswith(".xml"):
            try:
                return read_intrinsics(name, files.read(name))
            except DocumentError:
                continue
    return None
