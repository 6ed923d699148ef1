"""Views that show most of the arm's errors, and what they would leave of them at the points that matter.

Each view is a measurement of the flange's pose with the pixels' and the robot's noise; X, the target's places, the
errors of the arm, and what is not known of lens and target are its unknowns. Views are added one by one, each the one
after which the mean variance of registered points is least.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.kinematics.arm_errors import ArmErrorModel, Postures
from calibration.likelihood.chain import Chain
from calibration.likelihood.mapped_points import point_rows
from calibration.likelihood.mixed_model import linearise_model
from calibration.likelihood.predicted_uncertainty import Scene, observe_whole_target
from calibration.linear_algebra import inverse_or_pseudo_inverse
from calibration.observations.pose_model import derivative_by_shared
from calibration.transforms import Array, map_points

UNKNOWN_POSE_SIGMA = np.repeat([0.5, 500.0], 3)
"""rad, mm: of X and the target's places before any view."""

UNKNOWN_LENS_SIGMA = 1e3
"""px, or of a coefficient: of the intrinsics that the views estimate, before any view."""

MIN_PLACE_VIEWS = 4
"""Of each place of the target: fewer do not determine where it is, and so show nothing of the arm."""


@dataclass(frozen=True, eq=False)
class PointsOfInterest:
    """Where the uncertainty counts: at postures, one point (n, 3) of the camera's frame each."""

    postures: Postures
    points_mm: Array


class ArmExperiment:
    """The measurements that views of several places of the target would be. Camera on the flange.

    `scenes`, `postures`: one for each place; `sigmas` (k,) of the arm's errors. `known`: covariance of [X, places,
    errors, lens and target] after earlier views of all the places; without it nothing was seen before.
    """

    def __init__(
        self,
        model: ArmErrorModel,
        scenes: Sequence[Scene],
        postures: Sequence[Postures],
        interest: PointsOfInterest,
        sigmas: Array,
        known: Array | None = None,
    ) -> None:
        places = range(len(scenes))
        self.places = np.repeat(places, [len(each) for each in postures])
        self.rows = np.concatenate([np.arange(len(each)) for each in postures])
        parts = [_measurements(model, scenes[place], postures[place], place, len(scenes)) for place in places]
        self._by = np.concatenate([by for by, _ in parts])
        self._noise = np.concatenate([noise for _, noise in parts])
        poses = np.tile(UNKNOWN_POSE_SIGMA, 1 + len(scenes))
        of_nuisances = np.maximum(np.diagonal(scenes[0].prior_information())[12:], UNKNOWN_LENS_SIGMA**-2) ** -0.5
        before = np.diag(np.concatenate([poses, sigmas, of_nuisances]) ** 2)
        self._prior = before if known is None else known
        self._first_views = 0 if known is not None else MIN_PLACE_VIEWS
        nuisances = len(scenes[0].nuisances)
        self._weights = _point_weights(model, scenes[0].mount_T_camera, interest, len(scenes), nuisances)

    def point_mm(self, chosen: Sequence[int]) -> float:
        """RMS error of the points after these views (positions among all candidates), for an efficient estimate."""
        return float(np.sqrt(np.sum(self._weights * self.covariance(chosen))))

    def covariance(self, chosen: Sequence[int]) -> Array:
        """Covariance (p, p) of [X, places, errors, lens and target] after these views, for an efficient estimate."""
        if not len(chosen):
            return self._prior
        by, noise = self._by[list(chosen)], self._noise[list(chosen)]
        information = np.linalg.inv(self._prior) + np.einsum("nip,nij,njq->pq", by, np.linalg.inv(noise), by)
        return np.linalg.inv(information)

    def choose(self, count: int) -> tuple[list[tuple[int, int]], Array]:
        """`count` views, or all if fewer, as (place, row among its candidates), and the RMS of points after each, mm.

        MIN_PLACE_VIEWS of every place that no earlier view saw.
        """
        covariance, chosen, after = self._prior, [], []
        open_to = np.ones(len(self.places), bool)
        for number in range(min(count, len(self.places))):
            allowed = open_to
            if number < self._first_views * (1 + self.places.max()):
                allowed = open_to & (self.places == number // self._first_views)
            gains = np.where(allowed, self._gains(covariance), -np.inf)
            best = int(np.argmax(gains))
            open_to[best] = False
            chosen.append(best)
            by = self._by[best]
            spread = covariance @ by.T
            covariance = covariance - spread @ np.linalg.solve(by @ spread + self._noise[best], spread.T)
            after.append(np.sqrt(np.sum(self._weights * covariance)))
        return [(int(self.places[row]), int(self.rows[row])) for row in chosen], np.array(after)

    def _gains(self, covariance: Array) -> Array:
        """By how much each candidate (n,) would lower the mean variance of the points, mm²."""
        spread = self._by @ covariance  # (n, 6, p)
        inside = spread @ np.swapaxes(self._by, 1, 2) + self._noise
        weighed = spread @ self._weights @ np.swapaxes(spread, 1, 2)
        return np.asarray(np.trace(np.linalg.solve(inside, weighed), axis1=1, axis2=2))


def _measurements(
    model: ArmErrorModel, scene: Scene, postures: Postures, place: int, places: int
) -> tuple[Array, Array]:
    """Derivatives (n, 6 + q, p) of what views measure by all unknowns, and its covariance (n, 6 + q, 6 + q).

    The flange's pose, and what a picture shows of the q unknowns of lens and target beside that, with a deviation of 1.
    """
    poses = model.arm.forward(postures.joints_rad)
    chain = Chain(scene.setup, poses, scene.mount_T_camera, scene.anchor_T_target, np.zeros((len(poses), 6)))
    seen = chain.camera_T_target()
    nuisances = scene.nuisances
    statistics = nuisances.statistics(observe_whole_target(scene, poses), seen, np.zeros(len(nuisances)))
    linear, levels = linearise_model(statistics, chain, seen), scene.noise.variances()
    shared = np.linalg.solve(chain.correction_jacobian(seen), derivative_by_shared(seen))
    by_pixels = inverse_or_pseudo_inverse(linear.UU)
    errors = 6 + 6 * places
    across, q = linear.UAy[:, :, 12:-1], len(nuisances)
    beside = linear.squares[:, 12:-1, 12:-1] - np.swapaxes(across, 1, 2) @ by_pixels @ across
    values, axes = np.linalg.eigh(beside / levels.pixel)
    by = np.zeros((len(poses), 6 + q, errors + len(model) + q))
    by[:, :6, :6] = shared[:, :, :6]
    by[:, :6, 6 + 6 * place : 12 + 6 * place] = shared[:, :, 6:]
    by[:, :6, errors : errors + len(model)] = model.jacobian(np.zeros(len(model)), postures)
    by[:, :6, errors + len(model) :] = by_pixels @ across
    by[:, 6:, errors + len(model) :] = np.sqrt(np.maximum(values, 0.0))[..., None] * np.swapaxes(axes, 1, 2)
    noise = np.tile(np.eye(6 + q), (len(poses), 1, 1))
    noise[:, :6, :6] = levels.pixel * by_pixels + np.diag(levels.deviations() ** 2)
    return by, noise


def _point_weights(
    model: ArmErrorModel, mount_T_camera: Array, interest: PointsOfInterest, places: int, nuisances: int
) -> Array:
    """W (p, p) with trace(W cov) = the mean variance of the points."""
    points = interest.points_mm
    by_x = mount_T_camera[:3, :3] @ point_rows(points)
    by_arm = point_rows(map_points(mount_T_camera, points)) @ model.jacobian(np.zeros(len(model)), interest.postures)
    by_place, by_nuisance = (np.zeros((len(points), 3, count)) for count in (6 * places, nuisances))
    rows = np.concatenate([by_x, by_place, by_arm, by_nuisance], axis=-1)
    weights: Array = np.einsum("nip,niq->pq", rows, rows) / len(points)
    return weights
