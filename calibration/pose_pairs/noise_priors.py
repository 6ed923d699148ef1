"""What is known beforehand of how large the errors of robots and cameras are: little, and which go together."""

from dataclasses import dataclass

import numpy as np

from calibration.kinematics.robot_accuracy import PRIOR_NOISE
from calibration.transforms import Array

WIDELY = 10.0
"""One deviation of what robots and cameras are like: a tenth of the stated level to ten times that."""


@dataclass(frozen=True)
class Known:
    """Beforehand of a source: a level, or a share of another source's, and the `factor` of one deviation of it."""

    level: float
    factor: float = WIDELY
    of: str | None = None


KNOWN = {
    "robot rotation": Known(PRIOR_NOISE.rotation_rad),
    "robot translation": Known(PRIOR_NOISE.translation_mm),
    "arm": Known(float(np.radians(0.002))),
    "camera rotation": Known(float(np.radians(0.05))),
    "camera roll": Known(0.5, 3.0, of="camera rotation"),
    "camera lateral": Known(0.1),
    "camera depth": Known(2.0, 3.0, of="camera lateral"),
}
"""rad or mm, per axis. Whatever a camera is, it sees turns about the sight about as well as tilts or better, and
places along the sight about as well as those across it or worse."""


@dataclass(frozen=True, eq=False)
class Prior:
    """`shares` (g, g) @ levels are independent and normal about `stated` (g,), one deviation being `wide` (g,)."""

    shares: Array
    stated: Array
    wide: Array

    @property
    def mean(self) -> Array:
        """Of the levels (g,)."""
        return np.asarray(np.linalg.solve(self.shares, self.stated), np.float64)

    @property
    def deviations(self) -> Array:
        """Of each level (g,)."""
        root = np.linalg.solve(self.shares, np.diag(self.wide))
        return np.asarray(np.sqrt(np.sum(root**2, axis=1)), np.float64)

    def log_density(self, levels: Array) -> Array:
        """At levels (k, g), less what every density of as many dimensions has."""
        off = (levels @ self.shares.T - self.stated) / self.wide
        density: Array = -0.5 * np.sum(off**2, axis=1) - np.log(self.wide).sum()
        return density


def prior_of(sources: list[str]) -> Prior:
    """Of the logarithms of these sources' levels."""
    known = [KNOWN[name] for name in sources]
    shares = np.eye(len(known))
    for row, one in enumerate(known):
        if one.of:
            shares[row, sources.index(one.of)] = -1.0
    return Prior(shares, np.log([one.level for one in known]), np.log([one.factor for one in known]))
