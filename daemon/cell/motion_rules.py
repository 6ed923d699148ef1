"""Limits of commanded motion: box, reach, posture, joint travel and speed; and the move to a pose."""

from dataclasses import dataclass

import numpy as np

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.planning.reachability import reachable_by
from calibration.planning.viewpoint_selection import Reachable
from calibration.transforms import Array
from daemon.config.settings import RobotSettings, TaughtPose
from daemon.errors import PoseRefused
from drivers.interfaces import MoveGoal, PoseReading, Posture, Robot

MAX_PLANNED_TRAVEL_DEG = 120.0
"""Limit of joint travel in one move to a planned pose: short moves are easy to foresee, and cost no accuracy."""


@dataclass(frozen=True)
class MotionRules:
    """The checks before each move; the controller makes its own as well."""

    robot: RobotSettings
    arm: Arm | None

    @classmethod
    def of(cls, robot: RobotSettings) -> "MotionRules":
        return cls(robot, find_arm(robot.model) if robot.model else None)

    def check_poses(self, poses: tuple[TaughtPose, ...], joints_now_rad: Array | None) -> None:
        """Check that all poses lie in the box and, for a known arm, can be reached in turn. Raises PoseRefused."""
        for station, pose in enumerate(poses, start=1):
            self.check_inside_box(station, pose)
            if self.arm is not None and joints_now_rad is not None:
                joints_now_rad = self._joints(station, pose, self.arm, joints_now_rad)

    def check_inside_box(self, station: int, pose: TaughtPose) -> None:
        """Raises PoseRefused when the flange's origin at `pose` lies outside the box."""
        if not self.robot.inside_box(pose.transform()):
            at = ", ".join(f"{x:.1f}" for x in pose.translation_mm)
            low, high = (", ".join(f"{x:g}" for x in corner) for corner in self.robot.box_mm)
            raise PoseRefused(
                station,
                f"the flange would stand at ({at}) mm, outside the box from ({low}) to ({high})",
                "choose another pose, or correct [robot] box_mm",
            )

    async def goal(self, station: int, pose: TaughtPose, robot: Robot) -> MoveGoal:
        """The move from the present pose to `pose`. Raises PoseRefused, DeviceError."""
        self.check_inside_box(station, pose)
        here = await robot.read_pose()
        posture = await self._posture(station, pose, robot, here)
        return MoveGoal(
            base_T_flange=pose.transform(),
            posture=posture,
            external_axes=here.external_axes,
            speed_mm_s=self.robot.speed_mm_s,
        )

    async def _posture(self, station: int, pose: TaughtPose, robot: Robot, here: PoseReading) -> Posture:
        """As taught; else the posture with the least joint travel; else the posture the arm has now."""
        if pose.configuration is not None:
            return pose.configuration
        if self.arm is None:
            return here.posture
        return self.arm.configuration(self._joints(station, pose, self.arm, await robot.read_joints()))

    def _joints(self, station: int, pose: TaughtPose, arm: Arm, near_rad: Array) -> Array:
        try:
            if pose.configuration is not None:
                joints = arm.matching(pose.transform(), pose.configuration, near_rad)
            else:
                joints = arm.nearest(pose.transform(), near_rad)
        except UnreachablePoseError as error:
            raise PoseRefused(station, error.what, error.fix) from None
        travel_deg = np.degrees(np.abs(joints - near_rad))
        if travel_deg.max() > self.robot.joint_travel_deg:
            raise PoseRefused(
                station,
                f"axis {int(travel_deg.argmax()) + 1} would turn by {travel_deg.max():.0f}° in one move"
                f" (limit {self.robot.joint_travel_deg:g}°)",
                "put a pose between the two, choose a nearer one, or raise [robot] joint_travel_deg",
            )
        return joints

    def reachable_from(self, joints_now_rad: Array | None) -> Reachable | None:
        """Test of which poses the arm can take without a long turn of a joint; None when the arm is not known."""
        if self.arm is None or joints_now_rad is None:
            return None
        return reachable_by(
            self.arm, joints_now_rad, np.radians(min(self.robot.joint_travel_deg, MAX_PLANNED_TRAVEL_DEG))
        )
