"""The simulated arm: where its joints and its flange are, as functions of time handed in.

Two poses are told apart: the reported one (forward kinematics, float32 as the controller rounds it) and the true one,
off by the arm's error. The error is drawn anew for each departure and stays while the arm stands.
"""

from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.transforms import Array, rotation_angle_rad, rotation_from_vector, transform
from mock_robot.arm.paths import JointPath, LinePath, Path
from mock_robot.arm.speed_profile import Braked, Profile, Trapezoid

IN_POSITION_S = 0.3
"""How long the arm must have stood before it counts as settled: WaitTime \\InPos, 0.3."""
RAMP_S = 0.1
"""From standstill to the programmed speed, and back when told to stop."""
REORIENTATION_RAD_S = np.radians(500.0)
"""v_ori of ABB's predefined speeds v5 to v7000."""


@dataclass(frozen=True)
class RobotNoise:
    """How far the flange stands from where the controller believes: sigma of each component, and the seed."""

    translation_sigma_mm: float = 0.0
    rotation_sigma_rad: float = 0.0
    seed: int = 0

    def flange_T_true(self, departure: int) -> Array:
        """The error (4, 4) of the `departure`-th standstill; the same for the same number."""
        draw = np.random.default_rng([self.seed, departure]).standard_normal(6)
        return transform(rotation_from_vector(self.rotation_sigma_rad * draw[3:]), self.translation_sigma_mm * draw[:3])


@dataclass(frozen=True)
class Motion:
    """One move: a path, how fast along it, and since when."""

    path: Path
    profile: Profile
    start_s: float

    @property
    def end_s(self) -> float:
        """When the arm stands."""
        return self.start_s + self.profile.duration_s

    def along_at(self, now_s: float) -> float:
        """The part of the way done."""
        return self.profile.distance_at(now_s - self.start_s)

    def joints_at(self, now_s: float) -> Array:
        """Joints (6,)."""
        return self.path.joints_at(self.along_at(now_s))

    def braked(self, now_s: float) -> "Motion":
        """The same move, told to stop now."""
        deceleration = self.profile.speed_at(self.profile.duration_s / 2) / RAMP_S
        if now_s >= self.end_s or deceleration <= 0.0 or isinstance(self.profile, Braked):
            return self
        return replace(self, profile=Braked(self.profile, max(now_s - self.start_s, 0.0), deceleration))


def plan_motion(arm: Arm, start: Array, end: Array, speed_mm_s: float, linear: bool, now_s: float) -> Motion:
    """The move between two joint vectors at that flange speed, no axis above its own, up to where it is blocked."""
    path: Path = LinePath(arm, start, end) if linear else JointPath(start, end)
    if path.blocked_at <= 0.0:
        return Motion(JointPath(start, start, blocked_at=0.0), Trapezoid(0.0, 1.0, 1.0), now_s)
    along = np.linspace(0.0, path.blocked_at, 9)
    joints = np.array([path.joints_at(float(part)) for part in along])
    flange = arm.forward(joints)
    travel_mm = float(np.linalg.norm(np.diff(flange[:, :3, 3], axis=0), axis=-1).sum())
    turn_rad = float(np.sum(rotation_angle_rad(np.swapaxes(flange[:-1, :3, :3], -1, -2) @ flange[1:, :3, :3])))
    axis_s = float((np.abs(np.diff(joints, axis=0)) / np.array(arm.speed_rad_s)).max(-1).sum())
    cruise_s = max(travel_mm / speed_mm_s, turn_rad / REORIENTATION_RAD_S, axis_s)
    if cruise_s < 1e-9:
        return Motion(path, Trapezoid(0.0, 1.0, 1.0), now_s)
    speed = path.blocked_at / cruise_s
    return Motion(path, Trapezoid(path.blocked_at, speed, speed / RAMP_S), now_s)


class SimulatedArm:
    """The one owner of where the arm is. Times are the robot's own seconds; they never run backwards."""

    def __init__(self, arm: Arm, joints: Array, noise: RobotNoise, now_s: float = 0.0) -> None:
        arm.require_within_limits(joints)
        self.arm = arm
        self._noise = noise
        self._departures = 0
        self._motion = Motion(JointPath(joints, joints), Trapezoid(0.0, 1.0, 1.0), now_s - IN_POSITION_S)

    @property
    def departures(self) -> int:
        """How many moves have begun: what no duplicate may raise."""
        return self._departures

    @property
    def end_s(self) -> float:
        """When the present motion ends, or ended."""
        return self._motion.end_s

    def depart(self, joints: Array, speed_mm_s: float, linear: bool, now_s: float) -> float:
        """Begin a move from where the arm is now; return how far its path can be followed (1 = to its end)."""
        self._motion = plan_motion(self.arm, self.joints_at(now_s), joints, speed_mm_s, linear, now_s)
        self._departures += 1
        return self._motion.path.blocked_at

    def stop(self, now_s: float) -> None:
        """Slow down to standstill on the path; standing, nothing happens."""
        self._motion = self._motion.braked(now_s)

    def joints_at(self, now_s: float) -> Array:
        """Joints (6,) in rad."""
        return self._motion.joints_at(now_s)

    def moving_at(self, now_s: float) -> bool:
        """Is it under way?"""
        return now_s < self._motion.end_s

    def settled_at(self, now_s: float) -> bool:
        """Has it stood for IN_POSITION_S?"""
        return now_s >= self._motion.end_s + IN_POSITION_S

    def progress_at(self, now_s: float) -> float:
        """The part of the present move that is done."""
        return self._motion.along_at(now_s) if self.moving_at(now_s) else 1.0

    def reported_base_T_flange(self, now_s: float) -> Array:
        """Where the controller believes the flange to be (before rounding to float32)."""
        return self.arm.forward(self.joints_at(now_s))

    def true_base_T_flange(self, now_s: float) -> Array:
        """Where the flange is: what camera and scanner see."""
        return self.reported_base_T_flange(now_s) @ self._noise.flange_T_true(self._departures)
