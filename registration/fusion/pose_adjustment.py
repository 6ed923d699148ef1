"""Maximum a posteriori correction of all view poses from overlaps, with the robot's accuracy as the prior.

Each iteration finds counterparts for every pair, sums their information about 6 numbers per view, adds the prior (the
robot's rotation and translation error at the flange) and solves. Views without overlap, and directions that no
surface determines, keep the robot's pose, since only the prior constrains them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.kinematics.robot_accuracy import ABSOLUTE_NOISE, RobotNoise
from calibration.transforms import Array, map_points, rotation_from_vector, skew, transform, vector_from_rotation
from registration.fusion.overlap import Correspondences, correspond, pairs_within, reach_of
from registration.points.surface import CORRELATED_POINTS, Surface

FREE_SHARE = 0.004
"""Mean square of normal motion per unit motion below which a direction is free: normals err by up to 3 degrees."""

MAX_ITERATIONS = 25
STEP_TOLERANCE_MM = 2e-3
MIN_OVERLAP = 0.05


@dataclass(frozen=True, eq=False)
class PairEvidence:
    """For a twist u of the source against the target: minimise u' `information` u / 2 + `gradient`' u.

    `free` (k, 6): unit twists about `centre` that the surfaces leave undetermined; `sigma_mm`: robust size of the gaps.
    """

    information: Array
    gradient: Array
    free: Array
    sigma_mm: float
    used: int


@dataclass(frozen=True, eq=False)
class TwistFrame:
    """Twists [rotation rad × radius, translation] in mm, in base, about `origin` (3,): both halves are lengths."""

    origin: Array
    radius_mm: float

    @classmethod
    def around(cls, surfaces: Sequence[Surface], poses: Sequence[Array]) -> "TwistFrame":
        """About the centre of all views at `poses` (base_T_camera), with the RMS distance of their points from it."""
        placed = zip(surfaces, poses, strict=True)
        clouds = [map_points(pose, surface.points) for surface, pose in placed if len(surface.points)]
        if not clouds:
            return cls(np.zeros(3), 1.0)
        origin = np.mean([cloud.mean(axis=0) for cloud in clouds], axis=0)
        squares = [np.mean(np.sum((cloud - origin) ** 2, axis=1)) for cloud in clouds]
        return cls(origin, max(float(np.sqrt(np.mean(squares))), 1.0))

    def evidence(self, pair: Correspondences) -> PairEvidence:
        """Robustly weighted (Tukey's biweight) information of an overlapping pair about the motion between its views.

        Directions in which the two surfaces slide on each other (plane, cylinder, sphere) carry only noise and are
        removed (Zhang, Kaess, Singh: On degeneracy of optimization-based state estimation problems, ICRA 2016).
        """
        centre = pair.points.mean(axis=0)
        arms = pair.points - centre
        rows = np.hstack([np.cross(arms, pair.normals) / self.radius_mm, pair.normals])
        sigma_mm = max(1.4826 * float(np.median(np.abs(pair.gaps))), 0.01)
        weights = np.clip(1 - (pair.gaps / (4.685 * sigma_mm)) ** 2, 0, None) ** 2 / (sigma_mm**2 * CORRELATED_POINTS)
        information = (rows * weights[:, None]).T @ rows
        gradient = rows.T @ (weights * pair.gaps)
        values, vectors = np.linalg.eigh(information)
        free = values < FREE_SHARE * weights.sum()
        kept = vectors[:, ~free]
        information, gradient = kept @ (values[~free, None] * kept.T), kept @ (kept.T @ gradient)
        shift = np.eye(6)
        shift[3:, :3] = -skew(centre - self.origin) / self.radius_mm
        return PairEvidence(
            shift.T @ information @ shift,
            shift.T @ gradient,
            vectors[:, free].T,
            sigma_mm,
            int(np.count_nonzero(weights)),
        )

    def all_pairs(
        self, surfaces: Sequence[Surface], poses: Sequence[Array], reach_mm: float
    ) -> dict[tuple[int, int], PairEvidence]:
        """Evidence of every ordered pair of overlapping views."""
        pairs = {}
        for source, target in pairs_within(surfaces, poses, reach_mm):
            pair = correspond(surfaces[source], poses[source], surfaces[target], poses[target], reach_mm)
            if pair.enough and pair.fraction >= MIN_OVERLAP:
                pairs[source, target] = self.evidence(pair)
        return pairs

    def normal_equations(
        self,
        pairs: dict[tuple[int, int], PairEvidence],
        motions: Sequence[Array],
        base_T_flange: Sequence[Array],
        noise: RobotNoise,
    ) -> tuple[Array, Array, Array, Array]:
        """Information (6n, 6n) and gradient (6n,) of all twists: from the overlaps, then from the prior."""
        count = len(motions)
        seen, seen_gradient = np.zeros((count, 6, count, 6)), np.zeros((count, 6))
        for (source, target), pair in pairs.items():
            half = pair.information / 2  # a pair occurs twice, once from each side
            seen[source, :, source] += half
            seen[target, :, target] += half
            seen[source, :, target] -= half
            seen[target, :, source] -= half
            seen_gradient[source] += pair.gradient / 2
            seen_gradient[target] -= pair.gradient / 2
        prior, prior_gradient = np.zeros((count, 6, count, 6)), np.zeros((count, 6))
        weights = np.repeat([1 / noise.rotation_rad**2, 1 / noise.translation_mm**2], 3)
        for index, (motion, flange) in enumerate(zip(motions, base_T_flange, strict=True)):
            at_flange = self.at_flange(flange[:3, 3])
            prior[index, :, index] = at_flange.T @ (weights[:, None] * at_flange)
            prior_gradient[index] = at_flange.T @ (weights * np.concatenate(correction_of(motion, flange[:3, 3])[::-1]))
        size = 6 * count
        return seen.reshape(size, size), seen_gradient.ravel(), prior.reshape(size, size), prior_gradient.ravel()

    def at_flange(self, flange_mm: Array) -> Array:
        """(6, 6): a twist to [rotation rad, translation mm] of a flange."""
        at_flange = np.eye(6)
        at_flange[:3, :3] /= self.radius_mm
        at_flange[3:, :3] = -skew(flange_mm - self.origin) / self.radius_mm
        return at_flange

    def move(self, twists: Array, motions: Sequence[Array]) -> list[Array]:
        """The motions (4, 4), each followed by that of its twist (n, 6)."""
        moved = []
        for twist, motion in zip(twists, motions, strict=True):
            rotation = rotation_from_vector(twist[:3] / self.radius_mm)
            moved.append(transform(rotation, self.origin - rotation @ self.origin + twist[3:]) @ motion)
        return moved


@dataclass(frozen=True, eq=False)
class ViewCorrection:
    """`motion` (4, 4) in base, before the robot's pose; at the flange `translation_mm` (3,), `rotation_rad` (3,).

    `explained`: within three standard deviations of the robot's noise. `free` (k, 6): unit twists [rotation × radius,
    translation] in base that no overlap determines; all six without overlap.
    """

    motion: Array
    translation_mm: Array
    rotation_rad: Array
    explained: bool
    free: Array


@dataclass(frozen=True, eq=False)
class Refinement:
    """One correction per view, in order, and whether the iterations converged."""

    corrections: tuple[ViewCorrection, ...]
    iterations: int
    converged: bool


def refine_poses(
    surfaces: Sequence[Surface],
    base_T_camera: Sequence[Array],
    base_T_flange: Sequence[Array],
    noise: RobotNoise = ABSOLUTE_NOISE,
    at_iteration: Callable[[int], None] = lambda iteration: None,
) -> Refinement:
    """Corrections that align the views as far as the robot's noise allows. `at_iteration`: called before each."""
    motions = [np.eye(4) for _ in surfaces]
    frame, reach_mm = TwistFrame.around(surfaces, base_T_camera), reach_of(surfaces)
    step, iteration, settled = np.inf, 0, False
    pairs: dict[tuple[int, int], PairEvidence] = {}
    while iteration < MAX_ITERATIONS and not settled:
        iteration += 1
        at_iteration(iteration)
        poses = [motion @ pose for motion, pose in zip(motions, base_T_camera, strict=True)]
        pairs = frame.all_pairs(surfaces, poses, reach_mm)
        seen, seen_gradient, prior, prior_gradient = frame.normal_equations(pairs, motions, base_T_flange, noise)
        step_of_all = np.linalg.solve(seen + prior, seen_gradient + prior_gradient)
        twists: Array = -np.asarray(step_of_all, float).reshape(-1, 6)
        motions = frame.move(twists, motions)
        step = float(np.abs(twists).max()) if len(twists) else 0.0
        settled = step < STEP_TOLERANCE_MM
    corrections = tuple(
        _correction(index, motion, flange[:3, 3], noise, pairs)
        for index, (motion, flange) in enumerate(zip(motions, base_T_flange, strict=True))
    )
    return Refinement(corrections, iteration, settled)


def correction_of(motion: Array, flange_mm: Array) -> tuple[Array, Array]:
    """A motion as (translation of the flange in mm, rotation vector in rad)."""
    return motion[:3, :3] @ flange_mm + motion[:3, 3] - flange_mm, vector_from_rotation(motion[:3, :3])


def _correction(
    index: int,
    motion: Array,
    flange_mm: Array,
    noise: RobotNoise,
    pairs: dict[tuple[int, int], PairEvidence],
) -> ViewCorrection:
    translation_mm, rotation_rad = correction_of(motion, flange_mm)
    explained = (
        np.abs(translation_mm).max() <= 3 * noise.translation_mm
        and np.abs(rotation_rad).max() <= 3 * noise.rotation_rad
    )
    information: Array = np.zeros((6, 6)) + sum(
        (pair.information for key, pair in pairs.items() if index in key), np.zeros((6, 6))
    )
    values, vectors = np.linalg.eigh(information)
    free = values < 1e-6 * max(values[-1], 1e-12)
    return ViewCorrection(motion, translation_mm, rotation_rad, bool(explained), vectors[:, free].T)
