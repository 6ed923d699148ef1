"""Zivid: posNN.yaml (FloatMatrix, 4 x 4, mm) beside imgNN.png, .ply or .npz.

Source: zivid-python-samples, verify_hand_eye_with_visualization.py and save_load_matrix.py: poses are the robot's,
base_T_flange. A .zdf holds the camera's own format and needs its SDK: save a PLY or PNG beside it.
"""

import re
from dataclasses import replace

from calibration.documents.imports.pairing import pair
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import CLOUDS, PICTURES, Files, ImportedSet, of_suffix, read_one_each

_POSE = re.compile(r"(^|/)(pos|robot_pose_)_?\d+\.ya?ml$")
_IMAGE = re.compile(r"(^|/)(img|capture_)_?\d+\.\w+$")


def recognise(files: Files) -> bool:
    """Whether there are posNN.yaml beside imgNN."""
    return any(_POSE.search(name) for name in files.names) and any(_IMAGE.search(name) for name in files.names)


def read(files: Files, part: str | None) -> ImportedSet:
    """The set; PNG before PLY before NPZ. Raises DocumentError."""
    table = read_one_each(files, [name for name in files.names if _POSE.search(name)])
    poses = replace(table, unit="mm", frame="base_T_flange")
    found = [name for name in files.names if _IMAGE.search(name)]
    images = of_suffix(found, PICTURES) or of_suffix(found, CLOUDS)
    if not images:
        what, fix = "only .zdf, the camera's own format", "save PNG, PLY or NPZ beside them with Zivid's SDK"
        raise refusal(files.origin, "images", what, fix, "zivid")
    suffix = images[0].rsplit(".", 1)[1]
    paired = pair([name for name in images if name.endswith(suffix)], poses)
    return ImportedSet("Zivid", poses.take(paired.rows), paired.images, paired.words)
