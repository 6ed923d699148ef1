"""moveit_calibration's joint states (joint_names, joint_values in rad) with an arm whose kinematics are known.

Source: handeye_control_widget.cpp of moveit_calibration, saveJointStateBtnClicked.
"""

from typing import Any

import numpy as np

from calibration.documents.imports.pairing import natural, pair
from calibration.documents.imports.pose_table import PoseTable, table_of_matrices
from calibration.documents.imports.records import array_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.imported import PICTURES, Files, ImportedSet, of_suffix
from calibration.documents.imports.trees import read_yaml
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.abb_arms import find_arm

YAML = frozenset((".yaml", ".yml"))
MAX_TEXTS = 20
"""Files of a folder that are looked at."""

HEADING = "joint-states"


def find_joint_states(files: Files) -> str | None:
    """The name of the first file with joint states."""
    return next((name for name in of_suffix(files.names, YAML)[:MAX_TEXTS] if _states(files, name) is not None), None)


def _states(files: Files, name: str) -> dict[str, Any] | None:
    try:
        data = read_yaml(files.read(name), name)
    except DocumentError:
        return None
    return data if isinstance(data, dict) and {"joint_names", "joint_values"} <= set(data) else None


def read(files: Files, name: str, arm: str | None) -> ImportedSet:
    """The flange's poses by the arm's kinematics, paired with the pictures. Raises DocumentError."""
    poses = _poses(files, name, arm)
    paired = pair(of_suffix(files.names, PICTURES), poses)
    return ImportedSet("joint states", poses.take(paired.rows), paired.images, paired.words)


def _poses(files: Files, name: str, arm: str | None) -> PoseTable:
    states = _states(files, name) or {}
    joints, names = array_of(states.get("joint_values")), [str(one) for one in states.get("joint_names") or []]
    if joints is None or joints.ndim != 2 or joints.shape[1] != 6 or len(names) != 6:
        raise refusal(name, "joint_values", "not six joints in every row", "give those of a six-axis arm", HEADING)
    if arm is None:
        fix = "give the arm by --arm (`handeyed arms` lists them), or poses of the flange"
        raise refusal(name, "joint_values", "joint states, no poses", fix, HEADING)
    try:
        kinematics = find_arm(arm)
    except GeometryError as error:
        raise refusal("--arm", arm, str(error), "correct it", HEADING) from None
    order = sorted(range(6), key=lambda at: natural(names[at]))
    poses = kinematics.forward(np.asarray(joints)[:, order])
    labels = [str(at + 1) for at in range(len(poses))]
    table = table_of_matrices(name, labels, poses, f"{len(poses)} joint states of {kinematics.name}")
    return PoseTable(
        name, table.labels, table.lengths, table.numbers, table.kind, table.layout, table.convention, unit="mm",
        frame="base_T_flange",
    )  # fmt: skip
