"""Small turns of the flange about its own axes, to learn roughly where the camera sits when nobody said."""

from dataclasses import dataclass, replace

import numpy as np

from calibration.transforms import Array, rotation_from_vector, transform

AXES = {"z": (0.0, 0.0, 1.0), "x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
"""In the order in which they are tried: most cameras look along z, and a turn about it keeps the target in view."""

ANGLES_DEG = {
    "z": (15.0, -15.0, 8.0, -8.0),
    "x": (12.0, -12.0, 8.0, -8.0, 5.0, -5.0),
    "y": (12.0, -12.0, 8.0, -8.0, 5.0, -5.0),
}
"""One after the other until the target is seen: 10° between views or more determine X, little more leaves the image."""

TURNS_NEEDED = 2
"""About two axes: one leaves the translation along it open."""


@dataclass(frozen=True)
class Exploration:
    """Which turns were tried, by axis, and after which the target was seen."""

    tried: tuple[tuple[str, float], ...] = ()
    seen_about: frozenset[str] = frozenset()

    def next_turn(self) -> tuple[str, float] | None:
        """Axis and angle in degrees; None when two axes are done, or nothing is left to try."""
        if self.done:
            return None
        for axis in AXES:
            if axis in self.seen_about:
                continue
            for angle in ANGLES_DEG[axis]:
                if (axis, angle) not in self.tried:
                    return axis, angle
        return None

    @property
    def done(self) -> bool:
        return len(self.seen_about) >= TURNS_NEEDED

    def after(self, turn: tuple[str, float], seen: bool) -> "Exploration":
        """With one more turn tried; one that cannot be made counts as not seen."""
        about = self.seen_about | {turn[0]} if seen else self.seen_about
        return replace(self, tried=(*self.tried, turn), seen_about=about)


def turned(base_T_flange: Array, turn: tuple[str, float]) -> Array:
    """The flange (4, 4) turned where it stands."""
    axis, angle_deg = turn
    result: Array = base_T_flange @ transform(
        rotation_from_vector(np.radians(angle_deg) * np.array(AXES[axis])), np.zeros(3)
    )
    return result
