"""The views from which an arm's errors are identified: one place of the target after the other, and their chains."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, exact_pixels, linearise
from calibration.likelihood.mapped_points import point_rows
from calibration.likelihood.mixed_model import MixedModel
from calibration.observations.view_poses import refine_poses
from calibration.preprocessing.prepare import PreparedSession
from calibration.problem import anchor_T_mount_of
from calibration.transforms import Array, map_points
from extensions.arm_identification.mathematics.linear_models import join_places, with_distances


@dataclass(frozen=True, eq=False)
class TargetViews:
    """The views of the target at one place, and the estimate without errors of the arm from the `used` (n,) ones."""

    rows: PreparedSession
    used: NDArray[np.bool_]
    best: Estimate

    def camera_T_target(self) -> Array:
        """Each view's own pose (n, 4, 4), by the estimated camera."""
        poses = refine_poses(self.best.seen(self.rows.seen), self.best.camera, self.rows.camera_T_target)
        poses[self.used] = self.best.chain.camera_T_target()
        return poses

    def take(self, chosen: NDArray[np.bool_]) -> "TargetViews":
        """Only the chosen views; all of them are used."""
        return replace(self, rows=self.rows.take(chosen), used=np.ones(int(np.count_nonzero(chosen)), bool))


@dataclass(frozen=True)
class KnownDistance:
    """A distance, with one standard deviation, between the middles of the target at two places, counted from 0."""

    first: int
    second: int
    distance_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class CheckedDistance:
    """A known distance beside the one of the estimate, each with one standard deviation, mm."""

    known_mm: float
    known_sigma_mm: float
    found_mm: float
    found_sigma_mm: float

    @property
    def sigmas(self) -> float:
        """By how many standard deviations of both together they differ."""
        return abs(self.found_mm - self.known_mm) / float(np.hypot(self.known_sigma_mm, self.found_sigma_mm))


@dataclass(frozen=True, eq=False)
class ArmSession:
    """The views of m places, with their chains, and the errors (k,) that the chains' poses contain.

    The unknowns are X (6), the places (6 m), the nuisances of lens and target, and the arm's errors (k).
    `distances`: known ones between the places, in the order of `views`.
    """

    arm: ArmErrorModel
    postures: Postures
    views: Sequence[TargetViews]
    chains: Sequence[Chain]
    parameters: Array
    distances: Sequence[KnownDistance] = ()

    @property
    def places(self) -> NDArray[np.intp]:
        """The place (n,) of each view."""
        return np.repeat(np.arange(len(self.views)), [len(one.rows.seen) for one in self.views])

    @property
    def used(self) -> NDArray[np.bool_]:
        """(n,)"""
        return np.concatenate([one.used for one in self.views])

    @property
    def best(self) -> Estimate:
        """The estimate from the first place."""
        return self.views[0].best

    @property
    def poses(self) -> int:
        """Number of unknowns of X and the places."""
        return 6 + 6 * len(self.views)

    def take(self, chosen: NDArray[np.bool_]) -> "ArmSession":
        """Only the chosen views."""
        masks = [chosen[self.places == place] for place in range(len(self.views))]
        chains = [
            replace(chain, base_T_flange=chain.base_T_flange[mask], corrections=chain.corrections[mask])
            for chain, mask in zip(self.chains, masks, strict=True)
        ]
        views = [one.take(mask) for one, mask in zip(self.views, masks, strict=True)]
        return replace(self, postures=self.postures.take(chosen), views=views, chains=chains)

    def move(self, parameters: Array) -> "ArmSession":
        """The session about the arm with these errors; each view keeps its own pose."""
        built, chains, first = self.arm.forward(parameters, self.postures), [], 0
        for chain in self.chains:
            poses = built[first : first + len(chain.base_T_flange)]
            first += len(poses)
            chains.append(replace(chain, base_T_flange=poses).with_corrections_from(chain.camera_T_target()))
        return replace(self, chains=chains, parameters=parameters)

    def linearise(self) -> MixedModel:
        """The model without the arm's errors."""
        return join_places([self._linearise(one, chain) for one, chain in zip(self.views, self.chains, strict=True)])

    def _linearise(self, views: TargetViews, chain: Chain) -> MixedModel:
        best = self.best
        assert best.nuisances is not None
        return linearise(exact_pixels(views.rows.seen, best.nuisances), chain, best.nuisances, best.z)

    def add_distances(self, model: MixedModel) -> MixedModel:
        """The model with the known distances; its first unknowns are X, the places, and those of camera and size."""
        if not self.distances:
            return model
        middle = self.best.scale * self.views[0].rows.nominal_mm.mean(axis=0)
        rows, misses = np.zeros((len(self.distances), model.unknowns)), np.zeros(len(self.distances))
        places = [chain.anchor_T_target for chain in self.chains]
        for row, known in enumerate(self.distances):
            length, by_places, by_size = _length_between(places, known, middle)
            rows[row, 6 : self.poses], misses[row] = by_places, length - known.distance_mm
            rows[row, self.size_place()] = by_size
        return with_distances(model, rows, misses, np.array([known.sigma_mm for known in self.distances]))

    def check_distances(self, anchor_T_target: Array, scale: float, covariance: Array) -> tuple[CheckedDistance, ...]:
        """The known distances beside those between places (m, 4, 4) of covariance (6 m, 6 m); size taken as known."""
        middle, found = scale * self.views[0].rows.nominal_mm.mean(axis=0), []
        for known in self.distances:
            length, by_places, _ = _length_between(anchor_T_target, known, middle)
            sigma = float(np.sqrt(by_places @ covariance @ by_places))
            found.append(CheckedDistance(known.distance_mm, known.sigma_mm, length, sigma))
        return tuple(found)

    def size_place(self) -> int:
        """Place of the log of the target's size among the unknowns."""
        assert self.best.nuisances is not None
        return self.poses + self.best.nuisances.size


def _length_between(
    anchor_T_target: Sequence[Array] | Array, known: KnownDistance, middle_mm: Array
) -> tuple[float, Array, float]:
    """The distance between the two middles, its derivatives (6 m,) by the m places and by the target's size."""
    first, second = (anchor_T_target[place] for place in (known.first, known.second))
    between = map_points(second, middle_mm[None])[0] - map_points(first, middle_mm[None])[0]
    length = float(np.linalg.norm(between))
    by_places, by_size = np.zeros((len(anchor_T_target), 6)), 0.0
    for place, pose, sign in ((known.first, first, -1.0), (known.second, second, 1.0)):
        towards = sign * between / length @ pose[:3, :3]
        by_places[place] = towards @ point_rows(middle_mm[None])[0]
        by_size += float(towards @ middle_mm)
    return length, by_places.ravel(), by_size


def begin_arm_session(
    arm: ArmErrorModel, views: Sequence[TargetViews], postures: Postures, distances: Sequence[KnownDistance] = ()
) -> ArmSession:
    """The session at the drawing; X is that of the first place, of most views, a target where its first view has it."""
    drawn = np.split(arm.forward(np.zeros(len(arm)), postures), np.cumsum([len(one.rows.seen) for one in views])[:-1])
    x, chains = views[0].best.chain.mount_T_camera, []
    for one, base_T_flange in zip(views, drawn, strict=True):
        seen_T = one.camera_T_target()
        target = one.best.chain.anchor_T_target
        if one is not views[0]:
            first = np.flatnonzero(one.used)[:1]
            target = (anchor_T_mount_of(one.rows.setup, base_T_flange[first]) @ x @ seen_T[first])[0]
        chain = Chain(one.rows.setup, base_T_flange, x, target, np.zeros((len(seen_T), 6)))
        chains.append(chain.with_corrections_from(seen_T))
    return ArmSession(arm, postures, views, chains, np.zeros(len(arm)), tuple(distances))
