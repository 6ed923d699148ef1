"""Speed profiles: distance along a path as a pure function of time."""

from dataclasses import dataclass
from math import sqrt
from typing import Protocol


class Profile(Protocol):
    """Distance travelled (0 at the start) over time; `duration_s` is the time to standstill."""

    @property
    def duration_s(self) -> float: ...

    def distance_at(self, elapsed_s: float) -> float: ...

    def speed_at(self, elapsed_s: float) -> float: ...


@dataclass(frozen=True)
class Trapezoid:
    """Acceleration, constant speed, deceleration; a triangle when the path is too short to reach the speed."""

    length: float
    speed: float
    acceleration: float

    @property
    def peak_speed(self) -> float:
        """Highest speed reached."""
        return min(self.speed, sqrt(self.length * self.acceleration))

    @property
    def duration_s(self) -> float:
        """Duration from standstill to standstill."""
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
        """Speed after `elapsed_s`."""
        if not 0.0 < elapsed_s < self.duration_s:
            return 0.0
        return min(self.peak_speed, self.acceleration * min(elapsed_s, self.duration_s - elapsed_s))


@dataclass(frozen=True)
class Braked:
    """Follows profile `before` until `braked_at_s`, then decelerates to standstill on the same path."""

    before: Profile
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
        """Distance after `elapsed_s`."""
        if elapsed_s <= self.braked_at_s:
            return self.before.distance_at(elapsed_s)
        braking_s = min(elapsed_s - self.braked_at_s, self._speed / self.deceleration)
        travelled = self._speed * braking_s - 0.5 * self.deceleration * braking_s**2
        end = self.before.distance_at(self.before.duration_s)
        return min(self.before.distance_at(self.braked_at_s) + travelled, end)

    def speed_at(self, elapsed_s: float) -> float:
        """Speed after `elapsed_s`."""
        if elapsed_s <= self.braked_at_s:
            return self.before.speed_at(elapsed_s)
        return max(0.0, self._speed - self.deceleration * (elapsed_s - self.braked_at_s))
