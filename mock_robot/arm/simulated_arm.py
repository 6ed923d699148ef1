"""The simulated arm: joints and flange pose as functions of a time passed in.

The reported flange pose (forward kinematics of the drawing, rounded to float32 as by a controller) differs from the
true one by the errors of the arm as built, and by a random error, drawn anew for each move and constant while the arm
stands.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from calibration.kinematics.arm_errors import Postures
from calibration.kinematics.load import NO_LOAD, Load
from calibration.kinematics.seven_axes import AnyArm
from calibration.transforms import Array, rotation_angle_rad, rotation_from_vector, transform
from mock_robot.arm.built_arm import SWITCHED_ON_C, BuiltArm, warmth_k
from mock_robot.arm.paths import JointPath, LinePath, Path


@dataclass(frozen=True)
class Trapezoid:
    """Acceleration, constant speed, deceleration; a triangle when the path is too short to reach the speed."""

    length: float
    speed: float
    acceleration: float

    @property
    def peak_speed(self) -> float:
        return min(self.speed, sqrt(self.length * self.acceleration))

    @property
    def duration_s(self) -> float:
        if self.length <= 0.0:
            return 0.0
        return self.length / self.peak_speed + self.peak_speed / self.acceleration

    def distance_at(self, elapsed_s: float) -> float:
        """Distance after `elapsed_s`: 0 before the start, `length` after the end."""
        elapsed_s = min(max(elapsed_s, 0.0), self.duration_s)
        remaining_s = self.duration_s - elapsed_s
        ramp_s = self.peak_speed / self.acceleration
        if elapsed_s < ramp_s:
            return 0.5 * self.acceleration * elapsed_s**2
        if remaining_s < ramp_s:
            return self.length - 0.5 * self.acceleration * remaining_s**2
        return self.peak_speed * (elapsed_s - 0.5 * ramp_s)

    def speed_at(self, elapsed_s: float) -> float:
        if not 0.0 < elapsed_s < self.duration_s:
            return 0.0
        return min(self.peak_speed, self.acceleration * min(elapsed_s, self.duration_s - elapsed_s))


@dataclass(frozen=True)
class Braked:
    """Follows profile `before` until `braked_at_s`, then decelerates to standstill on the same path."""

    before: Trapezoid
    braked_at_s: float
    deceleration: float

    @property
    def duration_s(self) -> float:
        """Time to standstill, never later than without braking."""
        return min(self.before.duration_s, self.braked_at_s + self._speed / self.deceleration)

    @property
    def _speed(self) -> float:
        return self.before.speed_at(self.braked_at_s)

    def distance_at(self, elapsed_s: float) -> float:
        if elapsed_s <= self.braked_at_s:
            return self.before.distance_at(elapsed_s)
        braking_s = min(elapsed_s - self.braked_at_s, self._speed / self.deceleration)
        travelled = self._speed * braking_s - 0.5 * self.deceleration * braking_s**2
        end = self.before.distance_at(self.before.duration_s)
        return min(self.before.distance_at(self.braked_at_s) + travelled, end)

    def speed_at(self, elapsed_s: float) -> float:
        if elapsed_s <= self.braked_at_s:
            return self.before.speed_at(elapsed_s)
        return max(0.0, self._speed - self.deceleration * (elapsed_s - self.braked_at_s))


Profile = Trapezoid | Braked
"""Distance travelled (0 at the start) and speed over time; `duration_s` is the time to standstill."""

IN_POSITION_S = 0.3
"""Time of standstill after which the arm counts as settled: WaitTime \\InPos, 0.3."""
RAMP_S = 0.1
"""Time from standstill to the programmed speed, and from it to standstill on a stop."""
MIN_TRAVEL_RAD = 1e-6
"""An axis that turns by less takes up no play."""
REORIENTATION_RAD_S = np.radians(500.0)
"""v_ori of ABB's predefined speeds v5 to v7000."""


@dataclass(frozen=True)
class ArmNoise:
    """Standard deviations, per axis, of the true flange pose about the reported one, and the seed."""

    translation_sigma_mm: float = 0.0
    rotation_sigma_rad: float = 0.0
    seed: int = 0

    def flange_T_true(self, departure: int) -> Array:
        """Error (4, 4) at the standstill after move number `departure`; deterministic."""
        draw = np.random.default_rng([self.seed, departure]).standard_normal(6)
        return transform(rotation_from_vector(self.rotation_sigma_rad * draw[3:]), self.translation_sigma_mm * draw[:3])


@dataclass(frozen=True)
class ArmMotion:
    """One move: path, speed profile and start time."""

    path: Path
    profile: Profile
    start_s: float

    @property
    def end_s(self) -> float:
        """Time at which the arm comes to rest."""
        return self.start_s + self.profile.duration_s

    def along_at(self, now_s: float) -> float:
        """Fraction of the path done."""
        return self.profile.distance_at(now_s - self.start_s)

    def joints_at(self, now_s: float) -> Array:
        """Joints (6,) in rad."""
        return self.path.joints_at(self.along_at(now_s))

    def with_braking(self, now_s: float) -> "ArmMotion":
        if now_s >= self.end_s or isinstance(self.profile, Braked):
            return self
        deceleration = self.profile.speed_at(self.profile.duration_s / 2) / RAMP_S
        if deceleration <= 0.0:
            return self
        return replace(self, profile=Braked(self.profile, max(now_s - self.start_s, 0.0), deceleration))


def plan_motion(
    arm: AnyArm,
    start: Array,
    end: Array,
    speed_mm_s: float,
    linear: bool,
    now_s: float,
    turn_rad_s: float = REORIENTATION_RAD_S,
) -> ArmMotion:
    """Move between two joint vectors at that flange speed and reorientation, up to where the path is blocked.

    The axes' speeds limit it, too.
    """
    path: Path = LinePath(arm, start, end) if linear else JointPath(start, end)
    if path.reachable_fraction <= 0.0:
        return ArmMotion(JointPath(start, start, reachable_fraction=0.0), Trapezoid(0.0, 1.0, 1.0), now_s)
    along = np.linspace(0.0, path.reachable_fraction, 9)
    joints = np.array([path.joints_at(float(part)) for part in along])
    flange = arm.forward(joints)
    travel_mm = float(np.linalg.norm(np.diff(flange[:, :3, 3], axis=0), axis=-1).sum())
    turn_rad = float(np.sum(rotation_angle_rad(np.swapaxes(flange[:-1, :3, :3], -1, -2) @ flange[1:, :3, :3])))
    axis_s = float((np.abs(np.diff(joints, axis=0)) / np.array(arm.speed_rad_s)).max(-1).sum())
    cruise_s = max(travel_mm / speed_mm_s, turn_rad / turn_rad_s, axis_s)
    if cruise_s < 1e-9:
        return ArmMotion(path, Trapezoid(0.0, 1.0, 1.0), now_s)
    speed = path.reachable_fraction / cruise_s
    return ArmMotion(path, Trapezoid(path.reachable_fraction, speed, speed / RAMP_S), now_s)


class SimulatedArm:
    """Owner of the arm's position. Times are the robot's own seconds and must not decrease."""

    def __init__(
        self,
        arm: AnyArm,
        joints: Array,
        noise: ArmNoise,
        now_s: float = 0.0,
        built: BuiltArm | None = None,
        load: Load = NO_LOAD,
    ) -> None:
        arm.require_within_limits(joints)
        self.arm = arm
        self._noise, self._built, self._load, self._switched_on_s = noise, built, load, now_s
        self.lost_rad: Array = np.zeros(len(joints))
        """By how much each axis truly stands beyond what is reported: a zero lost after a collision or a new motor."""
        self._sides: Array = np.ones(len(joints))  # from which each axis last came: 1 from below
        self.departures = 0
        """Number of moves begun; a repeated request must not raise it."""
        self._motion = ArmMotion(JointPath(joints, joints), Trapezoid(0.0, 1.0, 1.0), now_s - IN_POSITION_S)

    @property
    def end_s(self) -> float:
        """End of the current motion, or of the last one."""
        return self._motion.end_s

    def depart(
        self, joints: Array, speed_mm_s: float, linear: bool, now_s: float, turn_rad_s: float = REORIENTATION_RAD_S
    ) -> float:
        """Start a move from the current position; returns the fraction of its path that can be followed (1: all)."""
        here = self.joints_at(now_s)
        self._come_from(here, joints)
        self._motion = plan_motion(self.arm, here, joints, speed_mm_s, linear, now_s, turn_rad_s)
        self.departures += 1
        return self._motion.path.reachable_fraction

    def jog(self, joints: Array, in_s: float, now_s: float) -> None:
        """Move to `joints` (6,) within `in_s`, as a person does with the joystick, whatever the axes' speeds.

        Raises UnreachablePoseError outside the joint limits.
        """
        self.arm.require_within_limits(joints)
        self.guide(joints, in_s, now_s)
        self.departures += 1

    def guide(self, joints: Array, in_s: float, now_s: float) -> None:
        """Go on to `joints` (6,) within `in_s`, as a part of one guided move."""
        self._come_from(self.joints_at(now_s), joints)
        profile = Trapezoid(1.0, 1.25 / in_s, 6.25 / in_s**2)  # a tenth of the time each to speed up and to brake
        self._motion = ArmMotion(JointPath(self.joints_at(now_s), joints), profile, now_s)

    def stop(self, now_s: float) -> None:
        """Brake to standstill on the path; no effect at standstill."""
        self._motion = self._motion.with_braking(now_s)

    def joints_at(self, now_s: float) -> Array:
        """Joints (6,) in rad."""
        return self._motion.joints_at(now_s)

    def is_moving_at(self, now_s: float) -> bool:
        return now_s < self._motion.end_s

    def is_settled_at(self, now_s: float) -> bool:
        """Whether the arm has stood still for IN_POSITION_S."""
        return now_s >= self._motion.end_s + IN_POSITION_S

    def progress_at(self, now_s: float) -> float:
        """Fraction of the current move that is done."""
        return self._motion.along_at(now_s) if self.is_moving_at(now_s) else 1.0

    def reported_base_T_flange(self, now_s: float) -> Array:
        """Flange pose as the controller computes it (before rounding to float32)."""
        return self.arm.forward(self.joints_at(now_s))

    def true_base_T_flange(self, now_s: float) -> Array:
        """True flange pose, as camera and scanner see it."""
        joints = self.joints_at(now_s) + self.lost_rad
        stands = self.arm.forward(joints)
        if self._built is not None:
            warmth = np.array([self.temperature_c(now_s) - SWITCHED_ON_C])
            stands = self._built.base_T_flange(Postures(joints[None], self._load, self._sides[None], warmth))[0]
        return stands @ self._noise.flange_T_true(self.departures)

    def temperature_c(self, now_s: float) -> float:
        """Of its links, as a thermometer on them shows."""
        return SWITCHED_ON_C + warmth_k(now_s - self._switched_on_s)

    def _come_from(self, here: Array, there: Array) -> None:
        """Note the side from which each axis comes; an axis that stands keeps its own."""
        travel = np.asarray(there) - here
        self._sides = np.where(np.abs(travel) > MIN_TRAVEL_RAD, np.sign(travel), self._sides)
