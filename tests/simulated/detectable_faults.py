"""What could be detected at all: a test that is told the kind of fault, but not the view, nor how noisy the robot is.

It tries what has to be tried (every view and number, every view of a change on either side, the target's size), at the
rate of false alarms that the diagnosis allows itself. The size at which it is right in 99 of 100 sessions like this one
is where faults begin to stand above the noise: a test that must find the same cannot do much better below.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, chndtr, fdtri

from calibration.diagnosis.diagnose import FALSE_ALARM_PROBABILITY
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit, apply_fit
from calibration.diagnosis.intrinsics_check import MIN_REPORTED_SHARE
from calibration.diagnosis.view_hypotheses import change_points
from calibration.observations.reprojection import INTRINSICS, pixel_statistics
from calibration.preprocessing.prepare import prepare
from calibration.problem import Problem
from calibration.transforms import Array
from tests.simulated.faults import Noise, Slip, clean_fit, poses_of

DRAWS = 400
RIGHT = 0.99
STEP = 1e-4
LEVER_MM = 573.0 / 3, 573.0 * 3
"""Translation noise over rotation noise, in mm per radian: 0.05 mm and 0.005 degrees, the usual levels, make 573."""

SIZES = np.concatenate([np.arange(3.0, 20.0, 0.25), np.arange(20.0, 60.0, 1.0), np.geomspace(60, 1000, 40)])


@dataclass(frozen=True, eq=False)
class Reach:
    """How often the oracle is right at each of `SIZES`, and what one deviation is in mm, or what the kind counts."""

    right: Array
    deviation: float
    least: float = 0.0
    """Deviations below which the fault does not matter, however plain it is."""

    @property
    def told_apart(self) -> bool:
        """Is there a size from which on it is right often enough?"""
        return bool(self.right[-1] >= RIGHT)

    @property
    def size(self) -> float:
        """In deviations: from here on it is right often enough, and matters."""
        return max(self._plain(), self.least)

    def _plain(self) -> float:
        wrong = np.flatnonzero(self.right < RIGHT)
        return float(SIZES[min(int(wrong[-1]) + 1, len(SIZES) - 1)]) if len(wrong) else float(SIZES[0])

    def power(self, size: float) -> float:
        """How often it is right at so many deviations."""
        return float(np.interp(size, SIZES, self.right))


@dataclass(frozen=True, eq=False)
class Linear:
    """A session as it is to first order: whitened derivatives (6n, p) by X and target, their complement's projector."""

    evidence: Evidence
    fitted: Fit
    root: Array
    projector: Array

    @classmethod
    def of(cls, problem: Problem, noise: Noise | None) -> "Linear":
        """`noise`: the robot's true levels; None: those that the clean session shows."""
        evidence, fitted = clean_fit(problem)
        if noise is not None:
            levels = np.square([np.radians(noise.robot_deg), noise.robot_mm])
            fitted = apply_fit(evidence, replace(fitted, variances=levels))
        root = np.linalg.inv(np.linalg.cholesky(fitted.covariance))
        by_shared = (root @ fitted.by_shared).reshape(6 * len(evidence), -1)
        orthonormal = np.linalg.qr(by_shared)[0]
        projector = np.eye(len(by_shared)) - orthonormal @ orthonormal.T
        return cls(evidence, fitted, root, projector)

    def slope_of(self, problem: Problem, slip: Slip) -> Array:
        """The slip's whitened derivative (6n,), across what X and target can take up."""
        spoilt = poses_of(slip.at(STEP).problem)[self.evidence.indices]
        residuals = apply_fit(self.evidence.with_robot_poses(spoilt), self.fitted).residuals
        return self._across((residuals - self.fitted.residuals) / STEP)

    def degrees(self, slope: Array) -> float:
        """Of an estimate of the slip's size, with noise levels estimated from the same views."""
        raw = np.linalg.solve(self.root, slope.reshape(-1, 6, 1))
        by_shared = np.concatenate([self.fitted.by_shared, raw], axis=2)
        return degrees_of_freedom(replace(self.fitted, by_shared=by_shared))

    def _across(self, by_view: Array) -> Array:
        whitened: Array = self.projector @ (self.root @ by_view[..., None])[..., 0].ravel()
        return whitened

    def numbers(self) -> tuple[Array, Array]:
        """Directions (6n, 6n) of one number in one view, orthonormal alone; the view of each."""
        n = len(self.evidence)
        every = np.zeros((6 * n, 6 * n))
        for view in range(n):
            block = slice(6 * view, 6 * view + 6)
            every[block, block] = self.root[view] @ self.fitted.by_robot[view]
        every = self.projector @ every
        return every / np.linalg.norm(every, axis=0), np.repeat(np.arange(n), 6)

    def changes(self) -> tuple[list[Array], list[tuple[int, int]]]:
        """Subspaces (6n, 6) of X, or the target's pose, being another from a view on; side and view of each."""
        n = len(self.evidence)
        bases, names = [], []
        for side, block in enumerate((slice(0, 6), slice(6, 12))):
            for point in change_points(n):
                after = np.where(np.arange(n)[:, None, None] >= point, self.fitted.by_shared[:, :, block], 0.0)
                bases.append(np.linalg.qr(self.projector @ (self.root @ after).reshape(6 * n, 6))[0])
                names.append((side, point))
        return bases, names


def degrees_of_freedom(fitted: Fit) -> float:
    """Of the variance of an estimate of the last shared unknown (Satterthwaite, Biometrics Bulletin 2(6), 1946).

    It rests on two levels of robot noise, estimated from the same views, and on each view's few pixels.
    """
    rotation, translation = fitted.variances
    levels = np.maximum(fitted.variances, [translation / LEVER_MM[1] ** 2, rotation * LEVER_MM[0] ** 2])
    spread = fitted.by_robot * np.repeat(levels - fitted.variances, 3)
    covariance = fitted.covariance + spread @ np.swapaxes(fitted.by_robot, 1, 2)
    weights = np.linalg.inv(covariance)
    n, _, p = fitted.by_shared.shape
    normal = (np.swapaxes(fitted.by_shared, 1, 2) @ weights @ fitted.by_shared).sum(axis=0)
    inner = np.swapaxes(fitted.by_robot, 1, 2) @ weights @ fitted.by_robot
    told = 0.5 * np.sum((inner**2).reshape(n, 2, 3, 2, 3), axis=(0, 2, 4)) * max(1 - p / (6 * n), 1 / (6 * n))
    size = 1 / np.sqrt(np.diagonal(told))
    doubt_of_levels = size[:, None] * np.linalg.inv(size[:, None] * told * size + 1e-9 * np.eye(2)) * size
    scale = 1 / np.sqrt(np.diagonal(normal))
    lever = (scale[:, None] * np.linalg.inv(scale[:, None] * normal * scale + 1e-12 * np.eye(p)) * scale)[-1]
    summed = weights @ fitted.by_shared @ lever
    by_robot = (np.swapaxes(fitted.by_robot, 1, 2) @ summed[..., None])[..., 0]
    by_level = (by_robot**2).reshape(-1, 2, 3).sum(axis=-1)
    whole = np.einsum("ni,nij,nj->n", summed, covariance, summed)
    by_pixels = np.maximum(whole - by_level @ levels, 0.0)
    by_levels = by_level.sum(axis=0)
    doubt = float(np.sum(2 * by_pixels**2 / fitted.redundancy)) + float(by_levels @ doubt_of_levels @ by_levels)
    return float(np.clip(2 * float(lever[-1]) ** 2 / max(doubt, 1e-300), 1.0, 1e6))


def _drawn(linear: Linear, degrees: float) -> tuple[Array, Array]:
    """Noise (6n, draws) without what X and target take up, and what the levels are taken for (draws,)."""
    rng = np.random.default_rng(0)
    noise = linear.projector @ rng.standard_normal((len(linear.projector), DRAWS))
    return noise, rng.chisquare(degrees, DRAWS) / degrees


def mistyped_reach(problem: Problem, slip: Slip, noise: Noise | None) -> Reach:
    """Of one number in one view, in mm."""
    linear = Linear.of(problem, noise)
    slope = linear.slope_of(problem, slip)
    unit, degrees = slope / np.linalg.norm(slope), linear.degrees(slope)
    directions, views = linear.numbers()
    spoilt = np.flatnonzero(np.any(poses_of(slip.at(1.0).problem) != poses_of(problem), axis=(1, 2)))[0]
    view = int(np.flatnonzero(linear.evidence.indices == problem.views[spoilt].index)[0])
    drawn, levels = _drawn(linear, degrees)
    limit = float(fdtri(1, degrees, 1 - FALSE_ALARM_PROBABILITY / (7 * len(linear.evidence))))
    by_noise, by_slip, own = directions.T @ drawn, directions.T @ unit, unit @ drawn
    right = []
    for size in SIZES:
        others = np.where((views == view)[:, None], 0.0, (by_noise + size * by_slip[:, None]) ** 2).max(axis=0)
        told = (own + size) ** 2
        right.append(float(np.mean((told / levels > limit) & (told > others))))
    return Reach(np.array(right), 1 / float(np.linalg.norm(slope)))


def moved_reach(problem: Problem, slip: Slip, noise: Noise | None) -> Reach:
    """Of a side that moved at some view, in mm."""
    linear = Linear.of(problem, noise)
    slope = linear.slope_of(problem, slip)
    unit, degrees = slope / np.linalg.norm(slope), linear.degrees(slope)
    bases, _ = linear.changes()
    # The subspace that the slip itself lies in: its own side, its own view.
    right_one = int(np.argmax([np.linalg.norm(basis.T @ unit) for basis in bases]))
    drawn, levels = _drawn(linear, degrees)
    limit = 6 * float(fdtri(6, degrees, 1 - FALSE_ALARM_PROBABILITY / len(bases)))
    by_noise = np.array([basis.T @ drawn for basis in bases])
    by_slip = np.array([basis.T @ unit for basis in bases])[..., None]
    right = []
    for size in SIZES:
        squares = np.sum((by_noise + size * by_slip) ** 2, axis=1)
        right.append(float(np.mean((squares.argmax(axis=0) == right_one) & (squares[right_one] / levels > limit))))
    return Reach(np.array(right), 1 / float(np.linalg.norm(slope)))


def scale_reach(problem: Problem, slip: Slip, noise: Noise | None) -> Reach:
    """Of a target of another size, as a share."""
    linear = Linear.of(problem, noise)
    slope = linear.slope_of(problem, slip)
    degrees = linear.degrees(slope)
    drawn, levels = _drawn(linear, degrees)
    own, limit = slope @ drawn / np.linalg.norm(slope), float(fdtri(1, degrees, 1 - FALSE_ALARM_PROBABILITY))
    right = [float(np.mean((own + size) ** 2 / levels > limit)) for size in SIZES]
    return Reach(np.array(right), 1 / float(np.linalg.norm(slope)))


def lens_reach(problem: Problem, change: Array, pixel: float) -> Reach:
    """Of a `change` (9,) of the intrinsics under pixel noise, in multiples of it; no less than is worth saying."""
    prepared = prepare(problem)
    sums = pixel_statistics(prepared.seen, prepared.camera, prepared.camera_T_target, free_intrinsics=True)
    coupling = sums.normal[:, :6, 6:]
    by_change = np.linalg.solve(sums.normal[:, :6, :6], coupling)
    across = np.swapaxes(coupling, 1, 2) @ by_change
    deviation = pixel / float(np.sqrt(change @ (sums.normal[:, 6:, 6:] - across).sum(axis=0) @ change))
    moved_mm = np.linalg.norm((by_change @ change)[:, 3:], axis=1)
    share = float(np.median(moved_mm / np.linalg.norm(prepared.camera_T_target[:, :3, 3], axis=1)))
    limit = float(chdtri(INTRINSICS, FALSE_ALARM_PROBABILITY))
    right = [float(1 - chndtr(limit, INTRINSICS, size**2)) for size in SIZES]
    return Reach(np.array(right), deviation, 2 * MIN_REPORTED_SHARE / (share * deviation))
