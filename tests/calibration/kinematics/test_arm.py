"""The arm's kinematics: published dimensions, an independent chain, and the way back."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calibration.errors import GeometryError
from calibration.kinematics.abb_arms import ARMS, find_arm
from calibration.kinematics.arm import (
    SINGULAR_ON_THE_WIRE,
    Arm,
    Configuration,
    OtherConfiguration,
    OutOfReach,
    OutsideJointLimits,
)
from calibration.transforms import Array, inverse, transform, transform_from_quaternion
from tests.calibration.kinematics.link_chain import DIFFERENT, LARGE, SMALL, joints_of, urdf_chain


@pytest.mark.parametrize(
    ("joints_deg", "position_mm", "quaternion_wxyz"),
    [
        ((0, 0, 0, 0, 0, 0), (815, 0, 1186.5), (0.5**0.5, 0, 0.5**0.5, 0)),
        ((90, 0, 0, 0, 0, 0), (0, 815, 1186.5), (0.5, -0.5, 0.5, 0.5)),
        ((0, 90, -90, 0, 0, 0), (1515, 0, 486.5), (0.5**0.5, 0, 0.5**0.5, 0)),  # stretched: 150 + 700 + 600 + 65
        ((0, 0, -90, 0, 0, 0), (150, 0, 1851.5), (1, 0, 0, 0)),  # upright: 486.5 + 700 + 600 + 65
        ((0, 0, 0, 0, 90, 0), (750, 0, 1121.5), (0, 0, 1, 0)),  # flange down
    ],
)
def test_home_and_dimension_sheet_poses(
    joints_deg: tuple[float, ...], position_mm: tuple[float, ...], quaternion_wxyz: tuple[float, ...]
) -> None:
    expected = transform_from_quaternion(position_mm, quaternion_wxyz)
    np.testing.assert_allclose(LARGE.forward(np.radians(joints_deg)), expected, atol=1e-9)


@pytest.mark.parametrize("arm", ARMS.values(), ids=lambda arm: arm.name)
def test_the_reach_is_the_one_in_the_name(arm: Arm) -> None:
    """As far as the name tells it: half its last digit, and the roundings of a data sheet."""
    named_m = re.findall(r"/(\d\.(\d+))", arm.name)[0]
    assert arm.reach_mm == pytest.approx(1e3 * float(named_m[0]), abs=500 * 0.1 ** len(named_m[1]) + 15)
    assert all(lower < 0 < upper for lower, upper in zip(arm.lower_rad, arm.upper_rad, strict=True))


def test_the_reach_is_that_of_the_stretched_arm() -> None:
    assert LARGE.reach_mm == pytest.approx(1450.0)
    stretched = LARGE.skeleton(np.radians([0, 90, -90, 0, 0, 0]))[2]
    assert np.hypot(*stretched[:2]) == pytest.approx(1450.0)


@pytest.mark.parametrize("arm", DIFFERENT, ids=lambda arm: arm.name)
@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_forward_is_the_chain_of_links(arm: Arm, data: st.DataObject) -> None:
    joints = data.draw(joints_of(arm))
    np.testing.assert_allclose(arm.forward(joints), urdf_chain(arm, joints), atol=1e-9)


@pytest.mark.parametrize("arm", DIFFERENT, ids=lambda arm: arm.name)
@given(data=st.data())
@settings(max_examples=150, deadline=None)
def test_every_solution_maps_back_and_the_original_is_among_them(arm: Arm, data: st.DataObject) -> None:
    joints = data.draw(joints_of(arm))
    pose = arm.forward(joints)
    solutions = arm.inverse(pose, near_rad=joints)
    np.testing.assert_allclose(arm.forward(solutions), np.broadcast_to(pose, (len(solutions), 4, 4)), atol=1e-9)
    for solution in solutions:
        arm.require_within_limits(solution)
    if arm.singularity_clearance(joints) > 1e-3:
        assert np.abs(solutions - joints).max(-1).min() < 1e-9


@given(data=st.data())
@settings(max_examples=150, deadline=None)
def test_a_pose_and_its_confdata_bring_back_the_same_joints(data: st.DataObject) -> None:
    joints = data.draw(joints_of(LARGE))
    if LARGE.singularity_clearance(joints) < 1e-3:
        return
    back = LARGE.matching(LARGE.forward(joints), LARGE.configuration(joints), near_rad=joints)
    np.testing.assert_allclose(back, joints, atol=1e-9)


@given(data=st.data())
@settings(max_examples=80, deadline=None)
def test_branch_k_has_cfx_k(data: st.DataObject) -> None:
    branches = SMALL.branches(SMALL.forward(data.draw(joints_of(SMALL))))
    for cfx, joints in enumerate(branches):
        if np.isfinite(joints).all() and SMALL.singularity_clearance(joints) > 1e-6:
            assert SMALL.configuration(joints).cfx == cfx


@pytest.mark.parametrize(
    ("joints_deg", "expected"),
    [
        ((0, 0, 0, 0, 30, 0), (0, 0, 0, 0)),
        ((100, 0, 0, -10, -30, 190), (1, -1, 2, 1)),
        ((-100, 30, -150, 170, 40, -370), (-2, 1, -5, 2)),  # forearm folded behind the lower arm
        ((0, -80, 0, 0, -20, 0), (0, 0, 0, 5)),  # leaning back over axis 1
        ((0, -80, -120, 0, 60, 0), (0, 0, 0, 6)),
    ],
)
def test_confdata_by_abbs_definition(joints_deg: tuple[float, ...], expected: tuple[int, ...]) -> None:
    assert LARGE.configuration(np.radians(joints_deg)) == expected


def test_a_pose_read_as_float32_keeps_its_posture_at_a_quarter_turn_and_in_the_wrist_singularity() -> None:
    for joints_deg in [(0, 10, 10, 0, 40, 0), (90, 10, 10, -90, 40, 180), (10, 20, 15, 30, 0, 60)]:
        joints = np.radians(joints_deg)
        read = LARGE.forward(joints)
        read[:3, 3] = read[:3, 3].astype(np.float32)
        wxyz = Rotation.from_matrix(read[:3, :3]).as_quat(scalar_first=True).astype(np.float32)
        echoed = transform_from_quaternion(read[:3, 3], wxyz.astype(float))
        back = LARGE.matching(echoed, LARGE.configuration(joints), near_rad=joints)
        np.testing.assert_allclose(back, joints, atol=1e-5)


def test_turns_of_the_last_axis_are_all_listed() -> None:
    joints = np.radians([10, 20, 15, 30, 40, 20])
    sixth = np.degrees(LARGE.inverse(LARGE.forward(joints))[:, 5])
    assert {round(angle) for angle in sixth} >= {20, 380, -340}


def test_nearest_takes_the_shortest_way() -> None:
    now = np.radians([10, 20, 15, 30, 40, 350])
    np.testing.assert_allclose(LARGE.nearest(LARGE.forward(now), now + 0.01), now, atol=1e-9)


def test_forward_and_branches_take_stacks() -> None:
    joints = np.random.default_rng(3).uniform(LARGE.lower_rad, LARGE.upper_rad, (4, 5, 6))
    poses = LARGE.forward(joints)
    assert poses.shape == (4, 5, 4, 4)
    assert LARGE.branches(poses).shape == (4, 5, 8, 6)
    np.testing.assert_allclose(poses[2, 3], LARGE.forward(joints[2, 3]), atol=1e-12)
    np.testing.assert_allclose(LARGE.branches(poses)[2, 3], LARGE.branches(poses[2, 3]), atol=1e-9)


def test_too_far_too_near_and_limits_are_refused_by_name_and_size() -> None:
    down = Rotation.from_euler("y", np.pi).as_matrix()
    with pytest.raises(OutOfReach, match=r"1600-6/1\.45") as far:
        LARGE.inverse(transform(down, [2150, 0, 486.5 - 65]))
    assert far.value.excess_mm == pytest.approx(700.0)
    with pytest.raises(OutOfReach) as near:
        SMALL.inverse(transform(down, [10, 0, 290 - 72]))
    assert near.value.too_near
    assert near.value.excess_mm == pytest.approx(np.hypot(302, 70) - 270 - 10)
    stretched_too_far = LARGE.forward(np.radians([0, 0, 0, 0, 120, 0]))
    with pytest.raises(OutsideJointLimits, match=r"axis 5 .* 5\.00°") as limited:
        LARGE.inverse(stretched_too_far)
    assert limited.value.axis == 5


def test_another_configuration_is_refused_with_those_that_work() -> None:
    joints = np.radians([0, 20, 15, 0, 40, 0])
    with pytest.raises(OtherConfiguration) as refused:
        LARGE.matching(LARGE.forward(joints), (0, 0, 0, 6))
    assert Configuration(0, 0, 0, 0) in refused.value.available
    assert "[0, 0, 0, 6]" in str(refused.value)


@pytest.mark.parametrize(
    "pose",
    [
        np.full((4, 4), np.nan),
        np.diag([1.0, 1, -1, 1]),
        np.diag([1.1, 1, 1, 1]),
        np.eye(3),
        np.stack([np.eye(4)] * 2),
    ],
)
def test_what_is_no_pose_is_a_geometry_error(pose: Array) -> None:
    with pytest.raises(GeometryError):
        LARGE.inverse(pose)


def test_what_is_no_confdata_is_refused() -> None:
    pose = LARGE.forward(np.radians([10, 20, 15, 30, 40, 20]))
    with pytest.raises(GeometryError, match="four numbers"):
        LARGE.matching(pose, (0, 0, 0))  # type: ignore[arg-type]
    with pytest.raises(OtherConfiguration):
        LARGE.matching(pose, (0, 0, 0, 8))


@pytest.mark.parametrize("joints", [np.zeros(5), np.full(6, np.nan), 0.0])
def test_what_are_no_joints_is_a_geometry_error(joints: Array) -> None:
    with pytest.raises(GeometryError):
        LARGE.forward(joints)


def test_singularity_clearance_falls_to_zero_on_each_of_the_three() -> None:
    wrist, elbow = np.radians([10, 20, 15, 30, 0, 20]), np.radians([10, 20, -90, 30, 40, 20])
    shoulder = np.array([0, -np.arcsin(150 / 700), 0, 0, 0.5, 0])
    shoulder[2] = -np.pi / 2 - shoulder[1]  # forearm upright: wrist centre at x = 150 - 150
    for joints in (wrist, elbow, shoulder):
        assert LARGE.singularity_clearance(joints) < SINGULAR_ON_THE_WIRE
    assert LARGE.singularity_clearance(np.radians([10, 20, 15, 30, 40, 20])) > 0.3


def test_wrist_centre_on_axis_1_takes_axis_1_from_the_hint() -> None:
    shoulder = np.array([0.4, -np.arcsin(150 / 700), 0, 0.2, 0.5, 0])
    shoulder[2] = -np.pi / 2 - shoulder[1]
    pose = LARGE.forward(shoulder)
    solutions = LARGE.inverse(pose, near_rad=shoulder)
    assert np.abs(solutions - shoulder).max(-1).min() < 1e-6
    np.testing.assert_allclose(inverse(pose) @ LARGE.forward(solutions[0]), np.eye(4), atol=1e-9)


def test_arms_are_found_by_name_and_unknown_ones_named() -> None:
    assert find_arm("IRB 1600-6/1.45") is LARGE
    assert find_arm("irb1600-6/1.450") is LARGE
    with pytest.raises(GeometryError, match=r"near are .*IRB 1600-6/1\.45"):
        find_arm("IRB 1600-7/1.45")
    with pytest.raises(GeometryError, match="`handeyed arms` lists"):
        find_arm("KUKA")


def test_a_configuration_has_one_solution_but_with_a_straight_wrist_axis_4_is_free_within_its_quarter() -> None:
    joints = np.radians([10.0, 20, 15, 30, 40, 20])
    pose = LARGE.forward(joints)
    np.testing.assert_allclose(LARGE.all_matching(pose, LARGE.configuration(joints), joints), [joints], atol=1e-9)
    straight = np.radians([10.0, 20, 15, 30, 0, 20])
    pose, configuration = LARGE.forward(straight), LARGE.configuration(straight)
    found = LARGE.all_matching(pose, configuration, straight)
    np.testing.assert_allclose(LARGE.forward(found), np.broadcast_to(pose, (len(found), 4, 4)), atol=1e-6)
    assert {LARGE.configuration(each)[:3] for each in found[1:-1]} <= {(0, 0, 0), (0, 0, -1), (0, 1, 0), (0, 1, -1)}
    sixth = np.degrees(found[:, 5])
    assert np.degrees(found[:, 3]).max() - np.degrees(found[:, 3]).min() >= 45
    assert sixth.min() > -1e-2
    np.testing.assert_allclose(np.degrees(found[:, 3]) + sixth, 50.0, atol=1e-6)
