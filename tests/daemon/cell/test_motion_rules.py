"""Which moves are refused, and where on their way, before anything moves."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.seven_axes import IRB_14050
from calibration.transforms import Array, rotation_from_vector, transform
from daemon.cell.motion_rules import GOALS_ONLY, MotionRules
from daemon.config.settings import RobotSettings, TaughtPose
from daemon.errors import PathRefused, PoseRefused
from drivers.interfaces import PoseReading
from tests.calibration.kinematics.link_chain import urdf_chain
from tests.daemon.fakes import FakeRobot

ARM = find_arm("IRB 1600-6/1.45")
STANDS = np.radians([0.0, 20, 10, 0, 60, 0])
"""Joints of an arm whose flange is straight ahead of its base."""

FLANGE_MM = ARM.forward(STANDS)[:3, 3]


def turned(angle_deg: float, outwards_mm: float = 0.0) -> TaughtPose:
    """Where axis 1 takes the flange, `outwards_mm` further from the base."""
    at_mm = FLANGE_MM + np.array([outwards_mm, 0.0, 0.0])
    turn = transform(rotation_from_vector([0, 0, np.radians(angle_deg)]), np.zeros(3))
    return TaughtPose.of(turn @ transform(ARM.forward(STANDS)[:3, :3], at_mm))


def rules_with(x_mm: float, model: str | None = ARM.name, **others: Any) -> MotionRules:
    """A box around the arm that ends at `x_mm` in front of it."""
    box = ((-2000.0, -2000.0, 0.0), (x_mm, 2000.0, 2500.0))
    return MotionRules(RobotSettings(address="tcp://robot:1", model=model, box_mm=box, **others))


@dataclass
class JointRobot(FakeRobot):
    """Stands where its joints say; `off_mm`: the controller reports another place."""

    joints: Array = field(default_factory=STANDS.copy)
    off_mm: float = 0.0

    async def read_pose(self) -> PoseReading:
        self.base_T_flange = ARM.forward(self.joints) + transform(np.zeros((3, 3)), [self.off_mm, 0, 0]) * (
            np.arange(4)[:, None] < 3
        )
        return await super().read_pose()

    async def read_joints(self) -> Array:
        return self.joints


def test_a_swing_out_of_the_box_between_two_poses_inside_is_refused_by_place_and_size() -> None:
    rules, start = rules_with(FLANGE_MM[0] - 50), STANDS + np.radians([60.0, 0, 0, 0, 0, 0])
    with pytest.raises(PathRefused) as refused:
        rules.check_poses((turned(50), turned(-50)), start)
    error = refused.value
    assert error.station == 2
    assert error.along == pytest.approx(0.5, abs=0.05)
    assert error.outside_mm == pytest.approx(50.0, abs=1.0)
    assert error.flange_mm[1] == pytest.approx(0.0, abs=60.0)
    assert str(error).startswith("pose 2: at 50 % of the way the flange would be at (")
    assert "mm outside the box from (-2000, -2000, 0) to (" in str(error)
    rules.check_poses((turned(50), turned(20, -100), turned(0, -100), turned(-20, -100), turned(-50)), start)


def test_an_arm_that_stands_outside_goes_nowhere_but_may_stand_on_a_face() -> None:
    for poses in ((), (turned(60),)):
        with pytest.raises(PathRefused, match=r"before this move the flange stands at .* jog the arm into the box"):
            rules_with(FLANGE_MM[0] - 50).check_poses(poses, STANDS)
    rules_with(FLANGE_MM[0] - 0.3).check_poses((turned(60),), STANDS)


def test_of_an_arm_that_is_not_known_goals_only_are_checked_and_this_is_said() -> None:
    rules = rules_with(FLANGE_MM[0] - 50, model=None)
    rules.check_poses((turned(50), turned(-50)), None)
    assert rules.warnings() == [GOALS_ONLY]
    assert rules_with(2000).warnings() == []


async def test_the_same_holds_for_the_move_that_is_made() -> None:
    robot, rules = JointRobot(), rules_with(FLANGE_MM[0] - 50)
    robot.joints = STANDS + np.radians([50.0, 0, 0, 0, 0, 0])
    with pytest.raises(PathRefused, match="pose 3"):
        await rules.goal(3, turned(-50), robot)
    goal = await rules.goal(3, turned(30, -60), robot)
    assert goal.posture == (0, 0, 0, 0)


async def test_a_taught_configuration_is_judged_by_its_own_way() -> None:
    """The wrist turned over, axes 4 and 6 by half a turn each: axis 4 alone swings the flange."""
    robot = JointRobot()
    over = STANDS * np.array([1, 1, 1, 1, -1, 1]) + np.radians([0.0, 0, 0, 180, 0, 180])
    pose = TaughtPose.of(ARM.forward(STANDS)).model_copy(update={"configuration": ARM.configuration(over)})
    way_mm = np.array([urdf_chain(ARM, STANDS + a * (over - STANDS))[:3, 3] for a in np.linspace(0, 1, 100)])
    low, high = way_mm.min(0) - 1, way_mm.max(0) + 1
    assert (high - low).max() > 50

    def rules_of(low: Array, high: Array) -> MotionRules:
        box = (tuple(map(float, low)), tuple(map(float, high)))
        return MotionRules(RobotSettings(address="tcp://robot:1", model=ARM.name, box_mm=box))  # type: ignore[arg-type]

    assert (await rules_of(low, high).goal(1, pose, robot)).posture == ARM.configuration(over)
    tight_low, tight_high = np.minimum(FLANGE_MM, FLANGE_MM) - 20, FLANGE_MM + 20
    with pytest.raises(PathRefused):
        await rules_of(tight_low, tight_high).goal(1, pose, robot)


async def test_a_model_that_contradicts_the_controller_is_refused() -> None:
    robot = JointRobot(off_mm=9.0)
    await rules_with(2000).goal(1, turned(10), robot)
    robot.off_mm = 11.0
    with pytest.raises(PoseRefused, match=r"the flange is 11 mm and 0\.0 deg from where"):
        await rules_with(2000).goal(1, turned(10), robot)


@pytest.mark.slow
def test_what_the_planner_may_choose_is_not_refused_afterwards() -> None:
    """Also where turning the wrist over is the nearer way, and leaves the box."""
    rules, start = rules_with(FLANGE_MM[0] - 50), STANDS + np.radians([50.0, 0, 0, 80, -30, 0])
    rng = np.random.default_rng(3)
    poses = ARM.forward(start + rng.uniform(-2, 2, (600, 6)) * np.array([0.7, 0.15, 0.15, 1, 0.3, 1]))
    reachable = rules.reachable_from(start)
    assert reachable is not None
    inside = np.array([rules.robot.inside_box(pose) for pose in poses])
    chosen = reachable(poses) & inside
    refused = 0
    for pose, may in zip(poses, chosen, strict=True):
        try:
            rules.check_poses((TaughtPose.of(pose),), start)
        except PoseRefused:
            refused += 1
            assert not may
    assert chosen.sum() > 30
    assert refused > 30


YUMI = "IRB 14050-0.5/0.5"


@dataclass
class SevenAxisRobot(FakeRobot):
    """Reports the arm angle of where its joints are."""

    joints: Array = field(default_factory=lambda: np.radians([0.0, -60, 30, 0, 40, 0, 0]))

    async def read_pose(self) -> PoseReading:
        self.base_T_flange = IRB_14050.forward(self.joints)
        angle_deg = float(np.degrees(IRB_14050.arm_angle_rad(self.joints)))
        return replace(await super().read_pose(), arm_angle_deg=angle_deg)

    async def read_joints(self) -> Array:
        return self.joints


async def test_a_taught_pose_of_an_arm_with_seven_axes_keeps_its_arm_angle() -> None:
    robot, rules = SevenAxisRobot(), rules_with(2000, YUMI)
    here = await robot.read_pose()
    taught = TaughtPose.of(here.base_T_flange).model_copy(update={"arm_angle_deg": 12.5, "configuration": (0, 0, 0, 4)})
    goal = await rules.goal(1, taught, robot)
    assert (goal.arm_angle_deg, goal.posture) == (12.5, (0, 0, 0, 4))
    assert (await rules.goal(1, TaughtPose.of(here.base_T_flange), robot)).arm_angle_deg == here.arm_angle_deg
    assert "poses are taught, not planned" in rules.warnings()[0]
    with pytest.raises(PoseRefused, match="names no arm with seven axes"):
        rules_with(2000).check_poses((taught,), None)


async def test_joints_of_seven_axes_are_held_to_their_limits_and_to_the_reported_pose() -> None:
    robot, rules = SevenAxisRobot(), rules_with(2000, YUMI)
    here = await robot.read_pose()
    rules.check_joint_move(here, robot.joints, robot.joints + 0.1)
    with pytest.raises(PoseRefused, match="axis 7 of IRB 14050"):
        rules.check_joint_move(here, robot.joints, robot.joints + np.radians([0, 0, 0, 0, 0, 0, 170]))
    with pytest.raises(PoseRefused, match="by the axes of IRB 14050"):
        rules.check_joint_move(here, robot.joints + 0.2, robot.joints)
