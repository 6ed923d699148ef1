"""How accurate robots are: every assumption made where the data do not show it. One standard deviation per axis.

From the smallest to the largest (translation, rotation), and what each is for:

    MIN_REPEATABILITY    0.01 mm, 0.001 deg   floor of a noise level while hypotheses are compared
    MIN_POSE_NOISE       0.02 mm, 0.002 deg   floor of an estimated noise level that weighs robot against clouds
    PRIOR_NOISE          0.2 mm,  0.02 deg    median of the prior on the noise level in a working volume
    MAX_USUAL_NOISE      1.0 mm,  0.1 deg     an estimated level above it is reported
    ABSOLUTE_NOISE       1.0 mm,  0.15 deg    assumed over a metre where no calibration has estimated it
    MAX_POSSIBLE_NOISE   15 mm,   1.5 deg     more is no robot's error: poses and images contradict each other

The first two are floors of estimates, the last three bounds of what is usual and of what is possible.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calibration.transforms import Array


@dataclass(frozen=True)
class RobotNoise:
    """One standard deviation of a robot pose, per axis, of its translation (mm) and of its rotation (rad)."""

    translation_mm: float
    rotation_rad: float

    def levels(self) -> Array:
        """(2,): rotation in rad, translation in mm, the order in which noise levels are estimated."""
        return np.array([self.rotation_rad, self.translation_mm])

    def is_within(self, most: "RobotNoise", share: float = 1.0) -> bool:
        """Whether both are at most that share of `most`."""
        return bool(np.all(self.levels() <= share * most.levels()))


MIN_REPEATABILITY = RobotNoise(0.01, float(np.radians(0.001)))
"""No robot repeats its poses better. Contradictions below it are the images' errors, and no fault is sought there."""

MIN_POSE_NOISE = RobotNoise(0.02, float(np.radians(0.002)))
"""An estimate of zero from few views must not freeze the poses when clouds are registered."""

PRIOR_NOISE = RobotNoise(0.2, float(np.radians(0.02)))
"""An industrial robot in its working volume."""

PRIOR_FACTOR = 4.0
"""One deviation of the log-normal prior about PRIOR_NOISE: a quarter of it to four times it."""

STATED_FACTOR = 2.0
"""The same about a level that somebody has stated."""

RUN_FACTOR = 1.25
"""By which a cell's noise differs from run to run: other places, other approaches."""


@dataclass(frozen=True)
class NoiseBelief:
    """What is believed of a robot's noise: log-normal about `median`, one deviation being these factors.

    `factors`: of rotation and translation. `origin`: "usual", "stated" or "learnt"; plans and statements use the same.
    `arm`: of which it is learnt.
    """

    median: RobotNoise = PRIOR_NOISE
    factors: tuple[float, float] = (PRIOR_FACTOR, PRIOR_FACTOR)
    origin: Literal["usual", "stated", "learnt"] = "usual"
    arm: str = ""

    def log_deviations(self, logs: Array) -> Array:
        """Distances (..., 2) of logarithms of levels from the median, in standard deviations."""
        return np.asarray((logs - np.log(self.median.levels())) / np.log(self.factors))

    def mean(self) -> RobotNoise:
        """The mean levels: U, nearly proportional to them, is expected to be the one at these."""
        rotation, translation = self.median.levels() * np.exp(np.log(self.factors) ** 2 / 2)
        return RobotNoise(float(translation), float(rotation))

    def for_next_run(self) -> "NoiseBelief":
        """The belief before the next run, after this one."""
        rotation, translation = (float(np.exp(np.hypot(np.log(f), np.log(RUN_FACTOR)))) for f in self.factors)
        return replace(self, factors=(rotation, translation), origin="learnt")


USUAL_BELIEF = NoiseBelief()

MAX_USUAL_NOISE = RobotNoise(1.0, float(np.radians(0.1)))
"""A robot with larger errors is a poor one, or its poses are in another convention."""

ABSOLUTE_NOISE = RobotNoise(1.0, float(np.radians(0.15)))
"""Absolute accuracy of articulated robots over a metre: 0.5 to 2 mm on real data."""

POSTURE_FACTOR = 4.0
"""Between two postures of an arm, in deviations of its absolute accuracy per axis."""

MAX_POSSIBLE_NOISE = RobotNoise(15.0, float(np.radians(1.5)))
"""Four times the errors of the worst real session at hand (3.8 mm, 0.34 degrees)."""


def postures_can_differ_by(translation_mm: float, rotation_rad: float) -> bool:
    """Whether an arm that is not calibrated can be off by so much more in one posture than in another."""
    most = POSTURE_FACTOR * ABSOLUTE_NOISE.levels()
    return bool(rotation_rad < most[0] and translation_mm < most[1])
