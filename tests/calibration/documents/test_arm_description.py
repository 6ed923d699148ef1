"""An arm of one's own: its line, URDF and Denavit-Hartenberg table are the same arm; what is none is refused."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.documents.arm_description import read_arm_description
from calibration.errors import CalibrationError, GeometryError
from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_row import read_arm_row, write_arm_row
from tests.calibration.kinematics.link_chain import DIFFERENT

HEADER = "a_mm,alpha_deg,d_mm,theta_deg,lower_deg,upper_deg"
QUARTER = "1.5707963267948966"


def urdf_of(arm: Arm, *, wrist_offset_mm: float = 0.0, third_axis: str = "0 1 0", tool: str = "tool0") -> str:
    """As an integrator writes it: a mesh frame turned about z in between, metres and radians, tool0 on the flange."""
    origins = [
        (0.0, 0.0, arm.shoulder_height_mm - 30.0),
        (arm.shoulder_forward_mm, 0.0, 30.0),
        (0.0, 0.0, arm.lower_arm_mm),
        (0.0, 0.0, arm.elbow_up_mm),
        (arm.forearm_mm, 0.0, wrist_offset_mm),
        (arm.flange_mm, 0.0, arm.wrist_offset_mm),
    ]
    axes = ["0 0 1", "0 2 0", third_axis, "1 0 0", "0 1 0", "1 0 0"]
    joints = "".join(
        f'<joint name="joint_{n}" type="revolute"><parent link="link_{n - 1}"/><child link="link_{n}"/>'
        f'<origin xyz="{x / 1e3} {y / 1e3} {z / 1e3}" rpy="0 0 0"/><axis xyz="{axis}"/>'
        f'<limit lower="{arm.lower_rad[n - 1]!r}" upper="{arm.upper_rad[n - 1]!r}" effort="0" velocity="2"/></joint>'
        for n, ((x, y, z), axis) in enumerate(zip(origins, axes, strict=True), 1)
    )
    fixed = '<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/><origin xyz="0 0 0" rpy="{}"/></joint>'
    return (
        f'<?xml version="1.0"?>\n<!-- an arm --><robot name="arm">{joints}'
        + fixed.format("flange", "link_6", tool, f"0 {QUARTER} 0")
        + fixed.format("mesh", "link_2", "beside", "0 0 1")
        + "</robot>"
    )


def classical_rows(arm: Arm) -> str:
    """The table of the drawing; the wrist centre is 4's d, the flange 6's."""
    a = [arm.shoulder_forward_mm, arm.lower_arm_mm, arm.elbow_up_mm, 0, 0, 0]
    d = [arm.shoulder_height_mm, 0, 0, arm.forearm_mm, 0, arm.flange_mm]
    alpha, theta = [-90, 0, -90, 90, -90, 0], [0, -90, 0, 0, 0, 180]
    limits = np.degrees([arm.lower_rad, arm.upper_rad]).T
    rows = zip(a, alpha, d, theta, *limits.T, strict=True)
    return "\n".join([HEADER, *(",".join(map(str, row)) for row in rows)])


def modified_rows(arm: Arm) -> str:
    """The same after Craig: each length and twist stands one row later; the last x needs no more."""
    rows = [row.split(",") for row in classical_rows(arm).splitlines()[1:]]
    before = [("0", "0"), *((row[0], row[1]) for row in rows[:-1])]
    header = HEADER.replace("a_mm,alpha_deg", "a_before_mm,alpha_before_deg")
    return "\n".join([header, *(",".join([*pair, *row[2:]]) for pair, row in zip(before, rows, strict=True))])


def same(read: Arm, arm: Arm) -> bool:
    joints = np.random.default_rng(1).uniform(arm.lower_rad, arm.upper_rad, (20, 6))
    limits = np.allclose([read.lower_rad, read.upper_rad], [arm.lower_rad, arm.upper_rad], atol=1e-5)
    return bool(np.allclose(read.forward(joints), arm.forward(joints), atol=1e-3)) and limits


@pytest.mark.parametrize("name", ARMS)
def test_a_line_is_its_arm(name: str) -> None:
    assert read_arm_row(write_arm_row(ARMS[name])) == ARMS[name]


def test_an_arm_is_found_by_its_line_again() -> None:
    line = write_arm_row(replace(ARMS["IRB 120-3/0.6"], name="our own"))
    found = find_arm(line)
    assert (found.name, found.identifier) == ("our own", line)
    assert find_arm(found.identifier) == found
    assert find_arm("irb 120-3/0.60").identifier == "IRB 120-3/0.6"


@pytest.mark.parametrize("arm", DIFFERENT, ids=lambda arm: arm.name)
def test_urdf_and_tables_are_the_arm(arm: Arm) -> None:
    for content, file in (
        (urdf_of(arm), "arm.urdf"),
        (classical_rows(arm), "arm.csv"),
        (modified_rows(arm), "arm.csv"),
    ):
        assert same(read_arm_description(content.encode(), file, name="own"), arm), content


def test_a_urdf_with_an_offset_wrist_is_that_arm_and_its_line_has_the_offset() -> None:
    gofa = ARMS["CRB 15000-5/0.95"]
    read = read_arm_description(urdf_of(gofa).encode(), "gofa.urdf", name="own")
    assert same(read, gofa)
    assert read.wrist_offset_mm == pytest.approx(80.0, abs=1e-3)
    assert read_arm_row(write_arm_row(read)).wrist_offset_mm == 80.0


def test_the_tip_is_named_where_it_is_not_tool0() -> None:
    content = urdf_of(DIFFERENT[0], tool="mounting_face").encode()
    assert same(read_arm_description(content, "a.urdf", name="own", tip="mounting_face"), DIFFERENT[0])
    with pytest.raises(CalibrationError, match="no joint ends at 'tool1'"):
        read_arm_description(content, "a.urdf", name="own", tip="tool1")
    with pytest.raises(CalibrationError, match="2 turning joints"):
        read_arm_description(content, "a.urdf", name="own", tip="beside")


ARM = DIFFERENT[1]


@pytest.mark.parametrize(
    ("content", "file", "words"),
    [
        (urdf_of(ARM, wrist_offset_mm=80.0), "a.urdf", "axis 5 passes axis 4 by 80.00 mm"),
        (urdf_of(ARM, third_axis="0 -1 0"), "a.urdf", r"axis 3 at zero points along \(0, -1, 0\)"),
        (urdf_of(ARM).replace(QUARTER, "0"), "a.urdf", "90.00 deg from tool0"),
        (urdf_of(ARM).replace('type="revolute"', 'type="fixed"', 1), "a.urdf", "5 turning joints"),
        (urdf_of(ARM).replace("link_0", "link_6"), "a.urdf", "hangs on itself"),
        (urdf_of(ARM).replace('axis xyz="0 0 1"', 'axis xyz="0 0 0"'), "a.urdf", "joint_1.*length 0"),
        (urdf_of(ARM).replace('velocity="2"', 'velocity="two"'), "a.urdf", "joint_1"),
        (urdf_of(ARM).replace("<limit ", "<limits "), "a.urdf", "joint_1: no lower and upper limit"),
        (urdf_of(ARM).replace('type="fixed"', 'type="prismatic"', 1), "a.urdf", "joint flange: it is prismatic"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><robot/>', "a.urdf", "declarations"),
        ("<robot><xacro:include/></robot>", "a.urdf", "xacro FILE"),
        ("<robot", "a.urdf", "not XML"),
        ("<robot/>", "a.urdf", "0 joints"),
        (classical_rows(ARM).rsplit("\n", 1)[0], "a.csv", "5 rows"),
        (classical_rows(ARM).replace("alpha_deg", "alpha"), "a.csv", "no columns a_mm, alpha_deg"),
        (classical_rows(ARM).replace("-115.0,115.0", "115,-115"), "a.csv", "lower limit"),
    ],
)
def test_what_is_no_such_arm_is_refused(content: str, file: str, words: str) -> None:
    with pytest.raises(CalibrationError, match=words):
        read_arm_description(content.encode(), file, name="own")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("own | 1 2 3 4 5 6", "an arm is 'name"),
        ("| 1 2 3 4 5 6 | 1 1 1 1 1 1", "an arm is 'name"),
        ("own | 1 2 3 4 5 | 1 1 1 1 1 1", "lengths are six"),
        ("own | 1 2 3 4 5 nan | 1 1 1 1 1 1", "lengths are six"),
        ("own | 1 2 0 4 5 6 | 1 1 1 1 1 1", "longer than 0"),
        ("own | 1 2 3 4 5 6 | 1 1 1 1 1", "limits are six"),
        ("own | 1 2 3 4 5 6 | 1 1 1 1 1 2/1", "'2/1' is empty"),
        ("own | 1 2 3 4 5 6 | 1 1 1 1 1 x", "'x' is no limit"),
        ("own | 1 2 3 4 5 6 | 1 1 1 1 1 1 | 1 1 1 1 1 0", "above 0"),
    ],
)
def test_a_line_that_is_no_arm_is_refused(line: str, words: str) -> None:
    with pytest.raises(GeometryError, match=words):
        find_arm(line)
