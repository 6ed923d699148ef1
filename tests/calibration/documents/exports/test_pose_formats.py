"""Planned poses: into the settings, and into RAPID, each read back by its own reader."""

import re
import tomllib

import numpy as np
import pytest

from calibration.documents.exports.formats import POSE_FORMATS, export_poses
from calibration.documents.exports.pose_list import PoseList, pose_list
from calibration.errors import ExportRefused
from calibration.kinematics.arm import Configuration
from calibration.transforms import difference, transform_from_quaternion
from daemon.config.settings import CalibrationSettings
from tests.calibration.documents.exports.some_poses import ARM, JOINTS_DEG, POSES
from tests.mock_robot.rapid.rules import offences
from tests.mock_robot.rapid.snippets import Snippet


def planned(with_arm: bool = True) -> PoseList:
    return pose_list("plan.json", POSES, ARM if with_arm else None)


def rapid_values(name: str, names: list[str]) -> list[list[list[float]]]:
    """The values a controller would read, by the mock's interpreter."""
    source = export_poses(planned(), name)
    assert [offence for offence in offences(source) if "integer" in offence.why or "CR LF" in offence.why] == []
    snippet = Snippet(source.decode("ascii"))
    return [snippet[each] for each in names]


@pytest.mark.parametrize("with_arm", [True, False])
def test_the_settings_take_them_as_pasted(with_arm: bool) -> None:
    text = export_poses(planned(with_arm), "poses-toml").decode()
    settings = CalibrationSettings.model_validate(tomllib.loads(f"[calibration]\n{text}")["calibration"])
    for taught, pose in zip(settings.poses, POSES, strict=True):
        apart_mm, apart_rad = difference(taught.transform(), pose)
        assert apart_mm < 1e-3
        assert apart_rad < 1e-6
    postures = [pose.configuration for pose in settings.poses]
    assert postures == list(planned(with_arm).configurations or [None] * 3)


def test_a_robtarget_leads_the_arm_to_the_same_posture() -> None:
    for number, value in enumerate(rapid_values("rapid-robtarget", ["he_pose_1", "he_pose_2", "he_pose_3"])):
        position, turn, posture, axes = value
        apart_mm, apart_rad = difference(transform_from_quaternion(position, turn), POSES[number])
        assert apart_mm < 1e-3
        assert apart_rad < 1e-6
        joints = ARM.matching(POSES[number], Configuration(*map(int, posture)), np.radians(JOINTS_DEG[number]))
        assert np.allclose(np.degrees(joints), JOINTS_DEG[number], atol=1e-6)
        assert np.allclose(axes, 9e9)


def test_a_jointtarget_has_the_axis_angles() -> None:
    for number, value in enumerate(rapid_values("rapid-jointtarget", ["he_joints_1", "he_joints_2", "he_joints_3"])):
        assert np.allclose(value[0], JOINTS_DEG[number], atol=1e-4)
        assert np.allclose(value[1], 9e9)


@pytest.mark.parametrize("name", ["rapid-robtarget", "rapid-jointtarget"])
def test_without_an_arm_no_posture_is_invented(name: str) -> None:
    with pytest.raises(ExportRefused, match="the arm is not known"):
        export_poses(planned(with_arm=False), name)


def test_a_pose_out_of_reach_is_named() -> None:
    far = POSES.copy()
    far[1, :3, 3] *= 5
    with pytest.raises(ExportRefused, match="pose 2"):
        pose_list("plan.json", far, ARM)


@pytest.mark.parametrize("name", POSE_FORMATS)
def test_a_hostile_title_ends_no_comment(name: str) -> None:
    text = export_poses(pose_list("a\nENDMODULE\n", POSES, ARM), name).decode()
    assert len(re.findall("ENDMODULE", text.split("from")[1].split("\n", 1)[1])) <= 1
