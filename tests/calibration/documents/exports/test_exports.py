"""X in every format, read back by somebody else's reader over 200 random X, at quarter turns and at half turns."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.documents.calibration import CalibrationDocument, CalibrationFindingDocument
from calibration.documents.exports.formats import FORMATS, export
from calibration.documents.exports.subject import ExportOptions
from calibration.documents.pose import PoseDocument
from calibration.errors import ExportRefused
from calibration.problem import PosesOf
from calibration.transforms import Array, difference, transform
from calibration.verdict import tool_findings
from mock_robot.rapid.syntax import parse_module
from tests.calibration.documents.exports.readers import READERS, joint_place, urdf_joints
from tests.daemon.calibrations import a_calibration

RANDOM = 200
TOLERANCE_MM, TOLERANCE_RAD = 2e-4, 4e-7
"""Half a unit of the fourth decimal of mm along three axes; half of the fifth of a degree about three."""


@cache
def some_x() -> tuple[Array, ...]:
    """Random poses, then pitch +-90 degrees, half turns about each axis, and none."""
    rng = np.random.default_rng(17)
    turns = list(Rotation.random(RANDOM, rng=rng).as_matrix())
    for pitch in (90, -90, 90 - 1e-6, -90 + 1e-4):
        turns += list(Rotation.from_euler("zyx", [[yaw, pitch, 30] for yaw in (0, 25, 160)], degrees=True).as_matrix())
    turns += [np.diag(each) for each in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1], [1.0, 1, 1])]
    return tuple(transform(turn, rng.uniform(-500, 500, 3)) for turn in turns)


def document_of(x: Array, setup: str = "eye-in-hand") -> CalibrationDocument:
    known, target = a_calibration("20261122-080000-abc123"), PoseDocument.of(np.eye(4))
    poses = {"flange_T_camera": None, "base_T_target": None, "base_T_camera": None, "flange_T_target": None}
    names = ("flange_T_camera", "base_T_target") if setup == "eye-in-hand" else ("base_T_camera", "flange_T_target")
    return known.model_copy(update={**poses, "setup": setup, names[0]: PoseDocument.of(x), names[1]: target})


def test_every_format_has_a_reader() -> None:
    assert list(READERS) == list(FORMATS)


@pytest.mark.parametrize("name", FORMATS)
def test_x_is_read_back(name: str) -> None:
    for x in some_x():
        read = READERS[name](export(document_of(x), name))
        apart_mm, apart_rad = difference(x, read)
        assert apart_mm < TOLERANCE_MM, (name, x)
        assert apart_rad < TOLERANCE_RAD, (name, x)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "csv"])
def test_a_comment_names_calibration_frames_and_verdict(name: str) -> None:
    x = some_x()[0]
    text = export(document_of(x), name).decode("utf-8", "replace")
    assert "20261122-080000-abc123" in text
    assert "camera_optical_frame" in text
    refused = document_of(x)
    refused = refused.model_copy(update={"verdict": a_calibration("x", accepted=False).verdict})
    assert "NOT ACCEPTED" not in text
    assert "NOT ACCEPTED" in export(refused, name).decode("utf-8", "replace")


@pytest.mark.parametrize("name", FORMATS)
def test_a_camera_that_stands_still_is_exported_in_the_base(name: str) -> None:
    content = export(document_of(some_x()[0], "eye-to-hand"), name)
    text = content.decode("utf-8", "replace")
    assert "tool0" not in text.replace("robot_effector_frame: tool0", "")
    assert "base" in text.lower()
    if name == "rapid":
        parse_module(text, "handeyed_data")
        assert "PERS wobjdata he_camera" in text
        assert "tooldata" not in text


@pytest.mark.parametrize("name", ["ros-tf", "zivid", "moveit", "usd", "kuka", "halcon"])
def test_the_body_frame_looks_along_its_x_axis(name: str) -> None:
    """link_T_optical by ROS's own angles: rpy -90, 0, -90 degrees (REP 103)."""
    link_T_optical = transform(Rotation.from_euler("xyz", [-90, 0, -90], degrees=True).as_matrix(), [0, 0, 0])
    for x in some_x()[::10]:
        content = export(document_of(x), name, ExportOptions(child="wrist_camera_link"))
        content = content.replace(b"wrist_camera_link", b"camera_optical_frame")
        apart_mm, apart_rad = difference(x, READERS[name](content) @ link_T_optical)
        assert apart_mm < TOLERANCE_MM
        assert apart_rad < TOLERANCE_RAD


def test_in_urdf_the_optical_frame_hangs_on_the_body_frame() -> None:
    x = some_x()[3]
    joints = urdf_joints(export(document_of(x), "urdf", ExportOptions(child="wrist_camera_link")))
    assert [joint.child for joint in joints] == ["wrist_camera_link", "camera_optical_frame"]
    assert joints[1].parent == "wrist_camera_link"
    apart_mm, apart_rad = difference(x, joint_place(joints[0]) @ joint_place(joints[1]))
    assert apart_mm < TOLERANCE_MM
    assert apart_rad < TOLERANCE_RAD


def test_decimals_are_chosen() -> None:
    text = export(document_of(some_x()[0]), "kuka", ExportOptions(decimals=1)).decode()
    assert len(text.split("X ")[1].split(",")[0].split(".")[1]) == 1


@pytest.mark.parametrize("options", [
    ExportOptions(parent="tool0\nENDMODULE"), ExportOptions(child='a"/><x'), ExportOptions(child=""),
    ExportOptions(decimals=10), ExportOptions(decimals=-1),
])  # fmt: skip
def test_names_and_decimals_are_checked(options: ExportOptions) -> None:
    with pytest.raises(ExportRefused):
        export(document_of(np.eye(4)), "ros-tf", options)


def test_an_unknown_format_names_the_nearest() -> None:
    with pytest.raises(ExportRefused, match="halcon"):
        export(document_of(np.eye(4)), "halkon")


def test_a_calibration_without_x_is_refused() -> None:
    with pytest.raises(ExportRefused, match="flange_T_camera"):
        export(a_calibration("unsolved", solved=False), "csv")


@pytest.mark.parametrize("name", FORMATS)
def test_a_hostile_id_ends_no_comment(name: str) -> None:
    hostile = document_of(some_x()[0]).model_copy(update={"id": 'a\nENDMODULE --> " */ {{x}} \r# é'})
    apart_mm, _ = difference(some_x()[0], READERS[name](export(hostile, name)))
    assert apart_mm < TOLERANCE_MM


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "csv"])
def test_x_of_a_tool_is_never_said_to_be_in_tool0(name: str) -> None:
    of_tool = next(tool_findings(PosesOf("t Grip\u00e9-1"), "eye-in-hand"))
    document = document_of(some_x()[0])
    findings = [CalibrationFindingDocument.of(of_tool)]
    verdict = document.verdict.model_copy(update={"findings": findings})
    text = export(document.model_copy(update={"verdict": verdict}), name).decode("utf-8", "replace")
    assert "CAUTION: the robot's poses were of t Grip_1, not of the flange in the base" in text
    assert "t_Grip_1" in text
    assert "tool0" not in text
