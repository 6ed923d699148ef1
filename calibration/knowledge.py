"""What is known of the target, the camera and the arm before a session, as priors: mixtures of normal densities.

None of them is exact. A statement narrows the core of a prior and keeps its tails, so that a wrong statement is found.
All standard deviations are about the described value, of shares (1e-3: 0.1 %), pixels or millimetres.
Sources: EU directive 2014/32/EU, annex X (rulers); M. Slamani, A. Nubiola & I. Bonev, "Assessment of the positioning
performance of an industrial robot", Industrial Robot 39(1), 2012 (arms); R. Willson & S. Shafer, "What is the center of
the image?", J. Opt. Soc. Am. A 11(11), 1994 (principal points). A page fitted to the paper is 2 to 6 % smaller.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from calibration.transforms import Array

Mixture = tuple[tuple[float, float], ...]
"""(probability, standard deviation) of each component."""

TargetSource = Literal["printed", "measured", "certified"]
CameraSource = Literal["this-session", "maker", "file", "nominal"]
ArmSource = Literal["as-delivered", "absolute-accuracy", "arm-json"]

Instrument = Literal["ruler-class-1", "ruler-class-2", "calliper", "measuring-machine"]

INSTRUMENT_ERRORS: dict[Instrument, tuple[float, float]] = {
    "ruler-class-1": (0.1, 0.1),
    "ruler-class-2": (0.3, 0.2),
    "calliper": (0.03, 0.0),
    "measuring-machine": (0.003, 0.004),
}
"""mm, mm per metre: largest error of a length, a + b L with L rounded up to whole metres (2014/32/EU for rulers)."""

READING_MM: dict[Instrument, float] = {
    "ruler-class-1": 0.1, "ruler-class-2": 0.1, "calliper": 0.01, "measuring-machine": 0.0,
}  # fmt: skip
"""One standard deviation of reading both ends, mm."""

MIN_SIZE_SIGMA = 1.5e-4
"""Of a certified target: aluminium by 6 K, 23 ppm/K."""

SIZE_TAIL: Mixture = ((0.04, 5e-3), (0.01, 4e-2))
"""Of a size that somebody has measured or certified: another pitch or target, and a page fitted to the paper."""

FOCAL_SHARE: dict[CameraSource, Mixture] = {
    "this-session": ((0.96, 5e-4), (0.03, 5e-3), (0.01, 2.5e-2)),
    "maker": ((0.80, 1e-3), (0.17, 6e-3), (0.03, 2.5e-2)),
    "file": ((0.80, 1e-3), (0.17, 6e-3), (0.03, 2.5e-2)),
    "nominal": ((0.9, 3e-2), (0.1, 1e-1)),
}
"""Of a focal length: before the last another focus, the last another setting of the lens, or another camera's file."""

CENTRE_PX: dict[CameraSource, Mixture] = {
    "this-session": ((0.97, 1.0), (0.03, 10.0)),
    "maker": ((0.80, 1.5), (0.16, 10.0), (0.04, 50.0)),
    "file": ((0.80, 1.5), (0.16, 10.0), (0.04, 50.0)),
    "nominal": ((0.9, 30.0), (0.1, 100.0)),
}
"""Of a principal point, per axis."""

LENS_PX: dict[CameraSource, float] = {"this-session": 0.1, "maker": 0.25, "file": 0.25, "nominal": 5.0}
"""Of radial distortion, at the picture's corner."""

TANGENTIAL_PX: dict[CameraSource, float] = {"this-session": 1.0, "maker": 1.0, "file": 1.0, "nominal": 5.0}
"""Of p1 and of p2 there, where the description has radial distortion alone: lenses show 0.1 to 2 px."""

OTHER_LENS_PX = (30.0, 5.0, 5.0)
"""Of k1, p1 and p2 there with the last component of the focal length."""

ARM_SHARE: dict[ArmSource, Mixture] = {
    "as-delivered": ((0.90, 5e-4), (0.10, 2e-3)),
    "absolute-accuracy": ((0.97, 1.5e-4), (0.03, 1e-3)),
    "arm-json": ((0.97, 1.5e-4), (0.03, 1e-3)),
}
"""Of the arm's millimetre: by as much as errors of arms, zeros and sag more than lengths, change it in one posture."""

MAX_RARE = 0.1
"""Probability up to which plans leave a component of a mixture out."""

ANISOTROPY_SHARE, SHEAR, BOW_SHARE = 1e-3, 5e-4, 2e-3
"""Of a print: stretch of one side against the other, angle between the sides, bow over half the target's size."""

BEND_SHARE = 1e-3
"""Of a print with bent lines: their bend in its plane, or by how much one side is longer than the middle."""

RIGID_TARGET = 0.1
"""Share of those for a target of glass or aluminium; its bow 0.25."""


@dataclass(frozen=True)
class TargetKnowledge:
    """How the target's size is known; `size_sigma`: one standard deviation as a share, for "measured", "certified"."""

    source: TargetSource = "printed"
    size_sigma: float | None = None

    @classmethod
    def measured(cls, length_mm: float, instrument: Instrument) -> "TargetKnowledge":
        """A size measured over `length_mm`; the instrument's errors are taken as equally likely (JCGM 100, 4.3.7)."""
        fixed, by_metre = INSTRUMENT_ERRORS[instrument]
        largest_mm = fixed + by_metre * float(np.ceil(length_mm / 1000))
        return cls("measured", float(np.hypot(largest_mm / np.sqrt(3), READING_MM[instrument]) / length_mm))

    def size_prior(self) -> Mixture:
        """Of the target's size against the description, as a share."""
        if self.source == "printed" or self.size_sigma is None:
            return ((0.70, 2e-3), (0.20, 8e-3), (0.10, 4e-2))
        least = MIN_SIZE_SIGMA if self.source == "certified" else 0.0
        return ((0.95, max(self.size_sigma, least)), *SIZE_TAIL)

    def shape_prior(self) -> tuple[tuple[float, float, float], ...]:
        """(probability, of the print's in-plane deviations, of its bow): shares of those of a print."""
        return ((0.95, RIGID_TARGET, 0.25), (0.05, 1.0, 1.0)) if self.source == "certified" else ((1.0, 1.0, 1.0),)


@dataclass(frozen=True)
class Knowledge:
    """What is stated about a session's target, camera and arm; as delivered and printed where nothing is."""

    target: TargetKnowledge = TargetKnowledge()
    camera: CameraSource = "file"
    arm: ArmSource = "as-delivered"


NOTHING_STATED = Knowledge()


@dataclass(frozen=True, eq=False)
class PriorMixture:
    """m components of a prior of q unknowns about zero: logarithms (m,) of probabilities, precisions (m, q).

    `arm_share` (m,): of the variance of the unknown `size`, the part that is the arm's millimetre. `usual` (q,):
    precisions of the widest components that are not rare, for plans.
    """

    log_weights: Array
    information: Array
    arm_share: Array
    usual: Array
    size: int

    def widest(self) -> Array:
        """Precisions (q,) of the widest component of each unknown."""
        return np.asarray(self.information.min(axis=0))


def prior_mixture(knowledge: Knowledge, bow_mm: float, distortion: tuple[float, ...] = ()) -> PriorMixture:
    """The prior of [log f, cx, cy, and `distortion`, px at the corner] and [log size, anisotropy, shear, three bows].

    The first are left out without `distortion`: where the camera is estimated. The target's size is against the arm's
    millimetre: the deviations of both add up. `bow_mm`: one standard deviation of a print's bow.
    """
    log_weights, information, arm_share = [], [], []
    focal, centre = FOCAL_SHARE[knowledge.camera], CENTRE_PX[knowledge.camera]
    of_lens: list[tuple[float, tuple[float, ...]]] = [(1.0, ())]
    if distortion:
        bent = {one: distortion for _, one in focal} | {focal[-1][1]: OTHER_LENS_PX[: len(distortion)]}
        of_lens = [(p * r, (one, off, off, *bent[one])) for (p, one), (r, off) in product(focal, centre)]
    of_size, of_arm, of_shape = knowledge.target.size_prior(), ARM_SHARE[knowledge.arm], knowledge.target.shape_prior()
    components = product(of_lens, of_size, of_arm, of_shape)
    for (by_lens, lenses), (by_size, size), (by_arm, arm), (by_shape, plane, bow) in components:
        log_weights.append(np.log(by_lens * by_size * by_arm * by_shape))
        information.append(_precisions(lenses, float(np.hypot(size, arm)), plane, bow * bow_mm))
        arm_share.append(arm**2 / (arm**2 + size**2))
    usual_lens = (_usual(focal), _usual(centre), _usual(centre), *distortion) if distortion else ()
    _, plane, bow = of_shape[0]
    usual = _precisions(usual_lens, float(np.hypot(_usual(of_size), _usual(of_arm))), plane, bow * bow_mm)
    return PriorMixture(np.array(log_weights), np.array(information), np.array(arm_share), usual, len(usual_lens))


def with_unknowns(prior: PriorMixture, place: int, sigmas: tuple[float, ...]) -> PriorMixture:
    """The prior with more unknowns from `place` on, each with one standard deviation in all components."""
    at, precisions = [place] * len(sigmas), 1 / np.square(sigmas)
    information, usual = (np.insert(one, at, precisions, axis=-1) for one in (prior.information, prior.usual))
    size = prior.size + len(sigmas) if place <= prior.size else prior.size
    return replace(prior, information=information, usual=usual, size=size)


def _precisions(lens: tuple[float, ...], size: float, plane: float, bow_mm: float) -> Array:
    return np.asarray(1 / np.square([*lens, size, plane * ANISOTROPY_SHARE, plane * SHEAR, bow_mm, bow_mm, bow_mm]))


def _usual(mixture: Mixture) -> float:
    """The widest standard deviation whose probability is above MAX_RARE."""
    return max(sigma for probability, sigma in mixture if probability > MAX_RARE)
