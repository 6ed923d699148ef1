"""Wide priors of the noise levels of robots and cameras."""

from dataclasses import dataclass

import numpy as np

from calibration.kinematics.robot_accuracy import PRIOR_NOISE
from calibration.transforms import Array

WIDE_PRIOR_FACTOR = 10.0
"""Factor of one standard deviation of a level's log-normal prior: a tenth of the median to ten times it."""


@dataclass(frozen=True)
class LevelPrior:
    """Log-normal prior of a source's level: median `level` and `factor` of one standard deviation.

    With `relative_to`, `level` is a ratio to the level of that source.
    """

    level: float
    factor: float = WIDE_PRIOR_FACTOR
    relative_to: str | None = None


LEVEL_PRIORS = {
    "robot rotation": LevelPrior(PRIOR_NOISE.rotation_rad),
    "robot translation": LevelPrior(PRIOR_NOISE.translation_mm),
    "arm": LevelPrior(float(np.radians(0.002))),
    "camera rotation": LevelPrior(float(np.radians(0.05))),
    "camera roll": LevelPrior(0.5, 3.0, relative_to="camera rotation"),
    "camera lateral": LevelPrior(0.1),
    "camera depth": LevelPrior(2.0, 3.0, relative_to="camera lateral"),
}
"""rad or mm, per axis. A camera measures roll about the line of sight about as well as tilt or better, and depth about
as well as lateral position or worse."""


@dataclass(frozen=True, eq=False)
class NoisePrior:
    """Joint prior of log levels (g,): `shares` (g, g) @ levels are independent, normal about `centres` (g,) with
    standard deviations `sigmas` (g,)."""

    shares: Array
    centres: Array
    sigmas: Array

    @property
    def mean(self) -> Array:
        """Mean of the log levels (g,)."""
        return np.asarray(np.linalg.solve(self.shares, self.centres), np.float64)

    @property
    def deviations(self) -> Array:
        """Standard deviation of each log level (g,)."""
        root = np.linalg.solve(self.shares, np.diag(self.sigmas))
        return np.asarray(np.sqrt(np.sum(root**2, axis=1)), np.float64)

    def log_density(self, levels: Array) -> Array:
        """Logarithm (k,) of the density at log levels (k, g), up to a constant."""
        off = (levels @ self.shares.T - self.centres) / self.sigmas
        density: Array = -0.5 * np.sum(off**2, axis=1) - np.log(self.sigmas).sum()
        return density


def prior_of(sources: list[str]) -> NoisePrior:
    """The joint prior of the logarithms of these sources' levels."""
    known = [LEVEL_PRIORS[name] for name in sources]
    shares = np.eye(len(known))
    for row, one in enumerate(known):
        if one.relative_to:
            shares[row, sources.index(one.relative_to)] = -1.0
    return NoisePrior(shares, np.log([one.level for one in known]), np.log([one.factor for one in known]))
