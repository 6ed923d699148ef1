"""RWHE of Tabb and Ahmad Yousef: robot_cali.txt (a count, then 4 x 4 matrices in mm), images/camera0.

Source: README of amy-tabb/RWHEC-Tabb-AhmadYousef and OpenCV's test of calibrateRobotWorldHandEye: the matrices B map
the base to the hand, flange_T_base; chess_width and chess_height are inner corners.
"""

import re
from dataclasses import replace
from typing import Any

from calibration.documents.imports.pairing import pair
from calibration.documents.imports.refusal import decode, refusal
from calibration.documents.imports.sets.imported import PICTURES, Files, ImportedSet, of_suffix
from calibration.documents.imports.text_tables import read_text_table

POSES, BOARD = "robot_cali.txt", "calibration_object.txt"


def recognise(files: Files) -> bool:
    """Whether there is a robot_cali.txt."""
    return POSES in files.names


def read(files: Files, part: str | None) -> ImportedSet:
    """One camera of the set; `part` names its folder below images. Raises DocumentError."""
    poses = replace(read_text_table(files.read(POSES), POSES), unit="mm", frame="flange_T_base")
    pictures = [name for name in of_suffix(files.names, PICTURES) if not name.startswith("internal_images/")]
    cameras = tuple(dict.fromkeys(name.rsplit("/", 1)[0] for name in pictures))
    chosen = [camera for camera in cameras if part is None or camera.rsplit("/", 1)[-1] == part]
    if len(chosen) != 1:
        what = f"{len(cameras)} folders with pictures ({', '.join(cameras[:6])})"
        raise refusal(files.origin, "--part", what, "name one: --part camera0", "rwhe")
    paired = pair([name for name in pictures if name.rsplit("/", 1)[0] == chosen[0]], poses)
    board = decode(files.read(BOARD), BOARD) if BOARD in files.names else ""
    return ImportedSet(
        "RWHE", poses.take(paired.rows), paired.images, paired.words, target=_target(board), setup="eye-in-hand"
    )


def _target(text: str) -> dict[str, Any] | None:
    said = dict(re.findall(r"(chess_\w+)\s+([-+.\d]+)", text))
    if not {"chess_mm_width", "chess_width", "chess_height"} <= set(said):
        return None
    return {
        "kind": "chessboard", "columns": said["chess_width"], "rows": said["chess_height"],
        "pitch_mm": said["chess_mm_width"],
    }  # fmt: skip
