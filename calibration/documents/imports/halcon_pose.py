"""HALCON's pose files (.dat), as write_pose writes them.

`f` is the sum of 1 (view: coordinate system), 2 (rotation abg), 4 (Rodrigues), 8 (R(p-T)): MVTec, create_pose.
gba is R = Rx Ry Rz, abg is R = Rz Ry Rx, both in degrees; the translation is in metres.
"""

import re

import numpy as np

from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import decode, refusal
from calibration.kinematics.conventions import CONVENTIONS

ORDERS = {0: "euler-XYZ", 2: "euler-xyz", 4: "rotation-vector"}


def read_halcon_pose(content: bytes, origin: str) -> PoseTable:
    """The pose of a .dat file. Raises DocumentError, also for intrinsics."""
    text = decode(content, origin)
    rows = dict(re.findall(r"^\s*([frt])\s+(.+?)\s*$", text, re.MULTILINE))
    if "r" not in rows or "t" not in rows:
        what = "intrinsics, no pose" if "ParGroup" in text else "no lines r and t"
        raise refusal(origin, "text", what, "give a file of write_pose", "halcon")
    try:
        code = int(rows.get("f", "0"))
        turn, length = (np.array([[float(number) for number in rows[key].split()]]) for key in ("r", "t"))
    except ValueError:
        raise refusal(origin, "text", "a number is damaged", "write the pose again", "halcon") from None
    if turn.shape != (1, 3) or length.shape != (1, 3) or code & 9 or code not in ORDERS:
        what = f"representation {code} of {turn.shape[1]} and {length.shape[1]} numbers is not read"
        raise refusal(origin, "f", what, "convert it: convert_pose_type(Pose, 'Rp+T', 'gba', 'point')", "halcon")
    if code == 4:
        length_of = np.linalg.norm(turn)  # the tangent of half the angle
        turn = turn * (2 * np.arctan(length_of) / length_of if length_of > 0 else 2.0)
    layout = f"a pose of HALCON, representation {code}"
    return PoseTable(origin, ("1",), length, turn, "angles", layout, CONVENTIONS[ORDERS[code]], unit="m").checked()
