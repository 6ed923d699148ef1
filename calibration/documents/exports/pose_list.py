"""Poses of the flange for `[calibration] poses` and for RAPID, with the posture that an arm takes."""

import re
from dataclasses import dataclass

import numpy as np

from calibration.documents.exports.rapid import module_text, pose_text
from calibration.documents.exports.subject import single
from calibration.errors import ExportRefused
from calibration.kinematics.arm import Arm, Configuration, UnreachablePoseError
from calibration.transforms import Array, quaternion_from_rotation

UNUSED_AXES = "[9E+09, 9E+09, 9E+09, 9E+09, 9E+09, 9E+09]"
"""External axes that do not exist."""

HOME_RAD = np.radians([0.0, 0.0, 0.0, 0.0, 30.0, 0.0])
"""ABB's usual home: the posture of the first pose is the nearest to it."""


@dataclass(frozen=True)
class PoseList:
    """`base_T_flange` (n, 4, 4) in mm. With an arm: `joints_rad` (n, 6) and the confdata of each."""

    title: str
    base_T_flange: Array
    joints_rad: Array | None = None
    configurations: tuple[Configuration, ...] | None = None

    def comment(self, marker: str) -> str:
        """What the poses are, behind `marker`."""
        title = re.sub(r"[^A-Za-z0-9 ._/-]", "?", self.title)[:64]
        return f"{marker} handeyed: poses of tool0 in the base, mm, quaternion w first with w >= 0; from {title}\n"


def pose_list(title: str, base_T_flange: Array, arm: Arm | None = None) -> PoseList:
    """The list; `arm` adds postures, each the nearest to the one before. Raises ExportRefused out of reach."""
    if arm is None:
        return PoseList(title, base_T_flange)
    joints, near = [], HOME_RAD
    for number, pose in enumerate(base_T_flange, start=1):
        try:
            near = arm.nearest(pose, near)
        except UnreachablePoseError as error:
            raise ExportRefused(f"pose {number}: {error.what}", error.fix) from None
        joints.append(near)
    return PoseList(title, base_T_flange, np.array(joints), tuple(arm.configuration(each) for each in joints))


def write_poses_toml(poses: PoseList) -> str:
    """`poses = [...]` of [calibration] or [scanner] in the settings."""
    lines = []
    for number, pose in enumerate(poses.base_T_flange):
        position = ", ".join(repr(round(value, 4) + 0.0) for value in pose[:3, 3].tolist())
        turn = ", ".join(repr(round(value, 9) + 0.0) for value in quaternion_from_rotation(pose[:3, :3]).tolist())
        posture = "" if poses.configurations is None else f", configuration = {[*poses.configurations[number]]}"
        lines.append(f"    {{ translation_mm = [{position}], quaternion_wxyz = [{turn}]{posture} }},\n")
    return poses.comment("#") + f"poses = [\n{''.join(lines)}]\n"


def write_robtargets(poses: PoseList) -> str:
    """A RAPID module of robtarget, with confdata."""
    if poses.configurations is None:
        raise ExportRefused("a robtarget has a confdata, and the arm is not known", "name it, as 'IRB 1600-6/1.45'")
    lines = [
        f"  CONST robtarget he_pose_{number} := [{pose_text(pose)[1:-1]}, {[*posture]}, {UNUSED_AXES}];\n"
        for number, (pose, posture) in enumerate(zip(poses.base_T_flange, poses.configurations, strict=True), start=1)
    ]
    return _module(poses, lines)


def write_jointtargets(poses: PoseList) -> str:
    """A RAPID module of jointtarget, in degrees."""
    if poses.joints_rad is None:
        raise ExportRefused("a jointtarget has axis angles, and the arm is not known", "name it, as 'IRB 1600-6/1.45'")
    lines = []
    for number, joints in enumerate(np.degrees(poses.joints_rad), start=1):
        angles = ", ".join(single(angle) for angle in joints)
        lines.append(f"  CONST jointtarget he_joints_{number} := [[{angles}], {UNUSED_AXES}];\n")
    return _module(poses, lines)


def _module(poses: PoseList, lines: list[str]) -> str:
    return module_text("handeyed_poses", poses.comment("  !") + "".join(lines))
