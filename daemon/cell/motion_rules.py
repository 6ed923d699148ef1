"""Limits of commanded motion: box, reach, posture, joint travel and speed; and the move to a pose."""

import asyncio
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from calibration.kinematics.abb_arms import find_any_arm
from calibration.kinematics.arm import Arm, UnreachablePoseError
from calibration.kinematics.joint_path import Box, leaves_box
from calibration.kinematics.seven_axes import AnyArm, SevenAxisArm
from calibration.planning.line_of_sight import LineOfSight
from calibration.planning.reachability import reachable_by
from calibration.planning.viewpoint_selection import Reachable
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, inverse, map_points
from daemon.cell.frame_check import frame_difference
from daemon.config.settings import RobotSettings, TaughtPose
from daemon.errors import PathRefused, PoseRefused
from drivers.interfaces import MoveGoal, PoseReading, Posture, Robot

MAX_PLANNED_TRAVEL_DEG = 120.0
"""Limit of joint travel in one move to a planned pose: short moves are easy to foresee, and cost no accuracy."""

BOX_SLACK_MM = 0.5
"""An arm that stands at a pose on a face of the box may be reported this far outside."""

GOALS_ONLY = (
    "the box is checked at goals only, not on the way between them: the arm is not known."
    " Choose poses between which the arm stays inside, or set [robot] model"
)

SEVEN_GOALS_ONLY = (
    "{arm} has seven axes: poses are taught, not planned, and the box is checked at goals only, not on the way between"
    " them. Choose poses between which the arm stays inside"
)


@dataclass(frozen=True)
class MotionRules:
    """The checks before each move; the controller makes its own as well.

    Of a known arm the whole path of the flange is checked, of another one the goal only.
    """

    robot: RobotSettings

    @cached_property
    def model(self) -> AnyArm | None:
        """The known arm, with six axes or seven."""
        return find_any_arm(self.robot.model) if self.robot.model else None

    @property
    def seven(self) -> SevenAxisArm | None:
        """The known arm where it has seven axes: its paths are not computed."""
        return self.model if isinstance(self.model, SevenAxisArm) else None

    @property
    def arm(self) -> Arm | None:
        """The known arm where it has six axes."""
        return None if isinstance(self.model, SevenAxisArm) else self.model

    def check_poses(self, poses: tuple[TaughtPose, ...], joints_now_rad: Array | None) -> None:
        """Check all poses and, for a known arm, where it stands and every move from one pose to the next.

        Joints None: only that each pose lies in the box. Raises PoseRefused.
        """
        if self.arm is not None and joints_now_rad is not None:
            self._check_path(1, self.arm, joints_now_rad, joints_now_rad)
        for station, pose in enumerate(poses, start=1):
            self._check_arm_angle(station, pose)
            self.check_inside_box(station, pose)
            if self.arm is not None and joints_now_rad is not None:
                joints_now_rad = self._check_move(station, pose, self.arm, joints_now_rad)

    def check_joint_move(self, here: PoseReading, start_rad: Array, end_rad: Array) -> None:
        """Check a move from `here`, joints `start_rad` (n,), to joints `end_rad` (n,): travel, limits and path.

        Of an arm that is not known, only travel; of one with seven axes, not the path. Raises PoseRefused.
        """
        self._check_travel(0, start_rad, end_rad)
        if self.model is None:
            return
        self._check_model(0, self.model, start_rad, here)
        try:
            self.model.require_within_limits(end_rad)
        except UnreachablePoseError as error:
            raise PoseRefused(0, error.what, error.fix) from None
        if self.arm is not None:
            self._check_path(0, self.arm, start_rad, end_rad)

    def check_controllers_box(self, low_mm: Sequence[float], high_mm: Sequence[float]) -> None:
        """Before a joint move of an arm that is not known, whose goal only the controller can check, by its own box.

        `low_mm`, `high_mm`: corners (3,) of that box in the controller's world. Raises PoseRefused when it is not
        within ours.
        """
        if self.arm is not None:
            return
        base_T_world = np.eye(4) if self.robot.world_T_base is None else inverse(self.robot.world_T_base)
        corners_mm = map_points(base_T_world, np.array(list(product(*zip(low_mm, high_mm, strict=True)))))
        low, high = np.array(self.robot.box_mm)
        if (corners_mm < low - BOX_SLACK_MM).any() or (corners_mm > high + BOX_SLACK_MM).any():
            controllers = box_words(low_mm, high_mm)
            what = Sentence("controllers-box-reaches-out", controllers=controllers, box=box_words(low, high))
            raise PoseRefused(0, what, Sentence("set-model-or-cell-box"))

    def with_travel_below(self, joint_travel_deg: float) -> "MotionRules":
        """These rules, with a limit of joint travel that is no larger than given."""
        lowest = min(self.robot.joint_travel_deg, joint_travel_deg)
        return replace(self, robot=self.robot.model_copy(update={"joint_travel_deg": lowest}))

    def check_inside_box(self, station: int, pose: TaughtPose) -> None:
        """Raises PoseRefused when the flange's origin at `pose` lies outside the box."""
        if not self.robot.inside_box(pose.transform()):
            (x_mm, y_mm, z_mm), box = pose.translation_mm, box_words(*self.robot.box_mm)
            who = "carried" if self.robot.carried_mm else "flange"
            what = Sentence(f"{who}-outside-box", x_mm=x_mm, y_mm=y_mm, z_mm=z_mm, box=box)
            raise PoseRefused(station, what, Sentence("choose-pose-or-box"))

    def fastest_mm_s(self, reach_mm: float, on_flange: Array | None) -> float:
        """Largest speed of flange, camera or target on it (4, 4), and carried points, however the flange turns.

        The robot program moves no point within `reach_mm` of the flange faster than the move's speed: its travel and
        `reach_mm` times its turn share it. A point farther out may be faster in proportion.
        """
        points = [self.robot.points_mm, *([] if on_flange is None else [on_flange[:3, 3]])]
        farthest_mm = float(np.linalg.norm(np.vstack(points), axis=-1).max())
        return self.robot.speed_mm_s * max(1.0, farthest_mm / reach_mm)

    def speed_mm_s(self, asked: float | None, usual: float) -> float:
        """Speed of a small move: as asked, else the usual one within the settings'. Raises PoseRefused."""
        allowed = self.robot.speed_mm_s
        if asked is not None and asked > allowed:
            what = Sentence("speed-too-high", asked_mm_s=asked, allowed_mm_s=allowed)
            raise PoseRefused(0, what, Sentence("ask-slower"))
        return min(usual, allowed) if asked is None else asked

    def warnings(self) -> list[str]:
        """What these rules cannot check, for GET /calibrate."""
        if self.seven is not None:
            return [SEVEN_GOALS_ONLY.format(arm=self.seven.name)]
        return [] if self.arm else [GOALS_ONLY]

    def _check_arm_angle(self, station: int, pose: TaughtPose) -> None:
        if pose.arm_angle_deg is not None and self.seven is None:
            raise PoseRefused(station, Sentence("no-seven-axes-named"), Sentence("leave-arm-angle-out"))

    async def goal(self, station: int, pose: TaughtPose, robot: Robot) -> MoveGoal:
        """The move from the present pose to `pose`. Raises PoseRefused, DeviceError."""
        self._check_arm_angle(station, pose)
        self.check_inside_box(station, pose)
        here = await robot.read_pose()
        return MoveGoal(
            base_T_flange=pose.transform(),
            posture=await self._posture(station, pose, robot, here),
            external_axes=here.external_axes,
            speed_mm_s=self.robot.speed_mm_s,
            arm_angle_deg=here.arm_angle_deg if pose.arm_angle_deg is None else pose.arm_angle_deg,
        )

    async def _posture(self, station: int, pose: TaughtPose, robot: Robot, here: PoseReading) -> Posture:
        """As taught; else the posture with the least joint travel; else the posture the arm has now.

        Computed in a thread: a wrist without a common point of its axes takes 30 ms.
        """
        if self.model is None:
            return pose.configuration or here.posture
        joints_now_rad = await robot.read_joints()
        self._check_model(station, self.model, joints_now_rad, here)
        if self.arm is None:
            return pose.configuration or here.posture
        joints = await asyncio.to_thread(self._check_move, station, pose, self.arm, joints_now_rad)
        return pose.configuration or self.arm.configuration(joints)

    def _check_model(self, station: int, arm: AnyArm, joints_now_rad: Array, here: PoseReading) -> None:
        """Raises PoseRefused when the arm's axes and its flange contradict the model, with which paths are computed."""
        found = frame_difference(arm, joints_now_rad, here)
        if not found.agrees:
            raise PoseRefused(station, found.what, found.fix)

    def _check_move(self, station: int, pose: TaughtPose, arm: Arm, start_rad: Array) -> Array:
        """Check reach, joint travel and path of the move from `start_rad` (6,); returns the joints at its end.

        For a pose without configuration the nearest solution, else the nearest in the posture that the arm has now:
        turning elbow or wrist over takes a way that nobody expects.
        """
        if pose.configuration is not None:
            return self._check_solutions(station, pose, pose.configuration, arm, start_rad)
        try:
            nearest = arm.nearest(pose.transform(), start_rad)
            all_solutions = arm.inverse(pose.transform(), start_rad)
        except UnreachablePoseError as error:
            raise PoseRefused(station, error.what, error.fix) from None
        try:
            return self._check_solutions(station, pose, arm.configuration(nearest), arm, start_rad)
        except PoseRefused:
            posture = arm.configuration(start_rad).cfx
            kept = [joints for joints in all_solutions if arm.configuration(joints).cfx == posture]
            if not kept or arm.configuration(nearest).cfx == posture:
                raise
        nearest = min(kept, key=lambda joints: float(np.abs(joints - start_rad).max()))
        return self._check_solutions(station, pose, arm.configuration(nearest), arm, start_rad)

    def _check_solutions(
        self, station: int, pose: TaughtPose, configuration: Posture, arm: Arm, start_rad: Array
    ) -> Array:
        """Check every move that the controller may make to the pose in that configuration; returns the nearest end."""
        cf1, cf4, cf6, cfx = configuration
        try:
            ends = arm.all_matching(pose.transform(), (cf1, cf4, cf6, cfx), start_rad)
        except UnreachablePoseError as error:
            raise PoseRefused(station, error.what, error.fix) from None
        for end_rad in ends:
            self._check_travel(station, start_rad, end_rad)
            self._check_path(station, arm, start_rad, end_rad)
        nearest: Array = ends[np.abs(ends - start_rad).max(-1).argmin()]
        return nearest

    def _check_travel(self, station: int, start_rad: Array, end_rad: Array) -> None:
        travel_deg = np.degrees(np.abs(end_rad - start_rad))
        if travel_deg.max() > self.robot.joint_travel_deg:
            axis, limit_deg = int(travel_deg.argmax()) + 1, self.robot.joint_travel_deg
            what = Sentence("axis-turns-too-far", axis=axis, travel_deg=travel_deg.max(), limit_deg=limit_deg)
            raise PoseRefused(station, what, Sentence("shorten-travel"))

    def _check_path(self, station: int, arm: Arm, start_rad: Array, end_rad: Array) -> None:
        found = leaves_box(arm, start_rad, end_rad, self._box, BOX_SLACK_MM, self.robot.points_mm)
        if found is not None:
            raise PathRefused(station, found, box_words(*self.robot.box_mm))

    @property
    def _box(self) -> Box:
        return Box(*self.robot.box_mm)

    def joints_along(self, base_T_flange: Array, joints_now_rad: Array | None) -> list[Array | None]:
        """Joints (6,) at each of the poses (n, 4, 4), each nearest to the one before; None where they are not known."""
        found: list[Array | None] = []
        near = joints_now_rad
        for pose in base_T_flange:
            joints = None
            if self.arm is not None and near is not None:
                with suppress(UnreachablePoseError):
                    joints = near = self.arm.nearest(pose, near)
            found.append(joints)
        return found

    def reachable_from(self, joints_now_rad: Array | None, sight: LineOfSight | None = None) -> Reachable | None:
        """Test of which poses the arm can take without a long turn of a joint; None when the arm is not known.

        `sight`: of a camera beside the robot, which the arm must not hide the target from.
        """
        if self.arm is None or joints_now_rad is None:
            return None
        travel_rad = np.radians(min(self.robot.joint_travel_deg, MAX_PLANNED_TRAVEL_DEG))
        return reachable_by(self.arm, joints_now_rad, travel_rad, self._box, self.robot.points_mm, sight)


def box_words(low_mm: Iterable[float], high_mm: Iterable[float]) -> Sentence:
    """A box by its corners (3,) and (3,), mm."""
    low, high = (", ".join(f"{x:g}" for x in corner) for corner in (low_mm, high_mm))
    return Sentence("box-from-to", low=low, high=high)
