"""Small turns of the flange about its own axes, which give a first X when no guess of it is configured."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.transforms import Array, rotation_from_vector, transform

AXES = {"z": (0.0, 0.0, 1.0), "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
"""In the order of trial: most cameras look along z, and a turn about z keeps the target in view."""

ANGLES_DEG = {
    "z": (15.0, -15.0, 8.0, -8.0),
    "x": (12.0, -12.0, 8.0, -8.0, 5.0, -5.0),
    "y": (12.0, -12.0, 8.0, -8.0, 5.0, -5.0),
}
"""Tried in turn until the target is detected: at least 5° to determine X, at most 15° to keep the target in view."""

MIN_TURNS = 2
"""Turns about different axes; a single axis leaves the translation along it undetermined."""


@dataclass(frozen=True)
class Exploration:
    """The turns tried so far (axis, degrees), and the axes about which one kept the target in view."""

    tried: tuple[tuple[str, float], ...] = ()
    seen_about: frozenset[str] = frozenset()

    def next_turn(self) -> tuple[str, float] | None:
        """The next axis and angle in degrees; None when the exploration is complete or nothing is left to try."""
        if self.is_complete:
            return None
        for axis in AXES:
            if axis in self.seen_about:
                continue
            for angle in ANGLES_DEG[axis]:
                if (axis, angle) not in self.tried:
                    return axis, angle
        return None

    @property
    def is_complete(self) -> bool:
        return len(self.seen_about) >= MIN_TURNS

    def after(self, turn: tuple[str, float], seen: bool) -> "Exploration":
        """The exploration with one more turn tried. `seen` False also for a turn that the arm cannot make."""
        about = self.seen_about | {turn[0]} if seen else self.seen_about
        return replace(self, tried=(*self.tried, turn), seen_about=about)


def turn_flange(base_T_flange: Array, turn: tuple[str, float]) -> Array:
    """The flange's pose (4, 4) after a turn (axis, degrees) about its own origin."""
    axis, angle_deg = turn
    result: Array = base_T_flange @ transform(
        rotation_from_vector(np.radians(angle_deg) * np.array(AXES[axis])), np.zeros(3)
    )
    return result
