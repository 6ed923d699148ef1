"""X of a line profiler and its clock, from points on spheres of known radius and on planes that stand in base.

A point p = (x, 0, z) taken at the time t of the sensor's clock lies at

    q = base_T_flange(t + offset) @ exp(error of the robot in this sweep) @ flange_T_profiler @ p

and its distance from the surface is zero but for the sensor's noise. Unknown are flange_T_profiler (6), the offset,
each surface (3: a centre, or a normal and a distance) and the robot's error in each sweep (6). That has a normal prior,
whose size is estimated as well (expectation maximisation; Dempster, Laird, Rubin 1977). Points next to each other share
errors (speckle, jitter of the times), so that the noise of a point is taken from the means of neighbouring points.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.errors import UndeterminedError
from calibration.kinematics.robot_accuracy import MIN_REPEATABILITY, PRIOR_NOISE, RobotNoise
from calibration.linear_algebra import covariance_of
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, rotation_from_vector, transform_from_vector
from registration.profiles.robot_path import RobotPath

MAX_ITERATIONS = 60
STEP_TOLERANCE = 1e-5
"""Of a step in units of `UNITS`, at which the estimate has converged."""
DIFFERENCE_S = 0.15
"""Half the time over which the arm's velocity is measured: poses whose times jitter by a millisecond then change it by
0.5 % from profile to profile. A velocity that changes at random looks as if planes showed the clock offset."""
NOISE_TOLERANCE = 0.002
"""Relative change of the robot's noise at which it has converged."""
MIN_POINT_NOISE_MM = 1e-3
NEIGHBOURS = 30
"""Points in a row that may share errors."""
PRIOR_WEIGHT = 1.0
"""Components of error for which the prior noise counts; each sweep has six."""
LEVER_MM = 300.0
UNITS = np.array([1 / LEVER_MM] * 3 + [1.0] * 3 + [0.01])
"""What moves a point by about a millimetre: rad, mm, and s at 100 mm/s."""
MIN_CLOCK_INFORMATION = 1e-6
MAX_SIGMA = 10.0
"""In these units: a larger standard deviation is not determined."""
MIN_SHARE = 0.15
"""Share of an unknown in what is not determined from which on it is named."""
FIX = Sentence("vary-sweeps")


@dataclass(frozen=True, eq=False)
class SweepPoints:
    """Points (k, 3) of one sweep on one surface in the profiler frame, y = 0, with their sensor times (k,), in order.

    `path`: the arm's during the sweep. `surface`: its number, or one for each point. `crossing`: of a sphere the time
    at which its centre is in the laser plane, and that centre (3,).
    """

    points_mm: Array
    times_s: Array
    path: RobotPath
    surface: int | NDArray[np.intp] = 0
    crossing: tuple[float, Array] | None = None


@dataclass(frozen=True, eq=False)
class FittedSurface:
    """A sphere about `place` (3,) with `radius_mm`, or (radius None) the plane normal . q = normal . place."""

    place: Array
    normal: Array
    radius_mm: float | None

    def residuals(self, points: Array) -> tuple[Array, Array]:
        """Signed distances (k,) of points (k, 3), and their gradients (k, 3)."""
        away = points - self.place
        if self.radius_mm is None:
            return away @ self.normal, np.broadcast_to(self.normal, points.shape)
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        return length - self.radius_mm, away / length[:, None]

    def jacobian(self, points: Array, gradient: Array) -> Array:
        """(k, 3) by the centre; or by two tilts about `place` and a shift along the normal."""
        if self.radius_mm is not None:
            return -gradient
        across = (points - self.place) @ self._tangents().T / LEVER_MM
        return np.column_stack([across, -np.ones(len(points))])

    def moved(self, step: Array) -> "FittedSurface":
        """The surface after a step (3,)."""
        if self.radius_mm is not None:
            return replace(self, place=self.place + step)
        normal = self.normal + step[:2] / LEVER_MM @ self._tangents()
        return replace(self, place=self.place + step[2] * self.normal, normal=normal / np.linalg.norm(normal))

    def _tangents(self) -> Array:
        """(2, 3) orthogonal to the normal and to each other."""
        first = np.cross(self.normal, np.eye(3)[np.argmin(np.abs(self.normal))])
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])


@dataclass(frozen=True, eq=False)
class ProfilerEstimate:
    """X (4, 4), the robot's clock minus the sensor's, the surfaces in base, the robot's errors (n, 6) in rad and mm."""

    flange_T_profiler: Array
    clock_offset_s: float
    surfaces: tuple[FittedSurface, ...]
    errors: Array

    def after(self, step: Array, errors: Array) -> "ProfilerEstimate":
        moved = [one.moved(part) for one, part in zip(self.surfaces, step[7:].reshape(-1, 3), strict=True)]
        x = self.flange_T_profiler @ transform_from_vector(step[:6])
        return ProfilerEstimate(x, self.clock_offset_s + float(step[6]), tuple(moved), self.errors + errors)


@dataclass(frozen=True, eq=False)
class ProfilerSolution:
    """`covariance` (7, 7): of [rotation rad, translation mm] of flange_T_profiler @ exp(.) in the profiler frame, and
    of the clock offset in s. `point_mm`: noise of a point; `robot`: of the arm's pose in a sweep. `residual_mm` (n,):
    RMS of each sweep.
    """

    estimate: ProfilerEstimate
    covariance: Array
    point_mm: float
    robot: RobotNoise
    residual_mm: Array
    converged: bool


class ProfilerProblem:
    """All points stacked; the arm's poses are computed once for each clock offset and linear in it close by."""

    def __init__(self, sweeps: Sequence[SweepPoints]) -> None:
        self.sweeps = tuple(sweeps)
        self.points = np.concatenate([sweep.points_mm for sweep in sweeps])
        counts = [len(sweep.points_mm) for sweep in sweeps]
        self.sweep_of: NDArray[np.intp] = np.repeat(np.arange(len(counts)), counts)
        self.surface_of = np.concatenate([np.broadcast_to(sweep.surface, len(sweep.points_mm)) for sweep in sweeps])
        self.place_s(0.0)

    def place_s(self, clock_offset_s: float) -> None:
        """Compute the arm's poses for an offset."""
        here = [sweep.path.at(sweep.times_s + clock_offset_s, np.inf, np.inf)[:, :3] for sweep in self.sweeps]
        rates = [_rate(sweep.path, sweep.times_s + clock_offset_s) for sweep in self.sweeps]
        self._offset_s, self._pose, self._rate = clock_offset_s, np.concatenate(here), np.concatenate(rates)

    def pose_at(self, clock_offset_s: float) -> tuple[Array, Array]:
        """base_T_flange (N, 3, 4) of every point, and its rate per second."""
        return self._pose + self._rate * (clock_offset_s - self._offset_s), self._rate

    def rows(self, estimate: ProfilerEstimate) -> tuple[Array, Array, Array]:
        """Residuals (N,), Jacobian (N, 7 + 3 surfaces), and that by the robot's error in the point's sweep (N, 6)."""
        pose, rate = self.pose_at(estimate.clock_offset_s)
        x = estimate.flange_T_profiler
        seen = self.points @ x[:3, :3].T + x[:3, 3]
        turned = rotation_from_vector(estimate.errors[:, :3])[self.sweep_of]
        flange = np.einsum("nij,nj->ni", turned, seen) + estimate.errors[self.sweep_of, 3:]
        base = np.einsum("nij,nj->ni", pose[:, :, :3], flange) + pose[:, :, 3]
        speed = np.einsum("nij,nj->ni", rate[:, :, :3], flange) + rate[:, :, 3]
        residuals, gradient = np.empty(len(base)), np.empty_like(base)
        jacobian = np.zeros((len(base), 7 + 3 * len(estimate.surfaces)))
        for index, surface in enumerate(estimate.surfaces):
            own = self.surface_of == index
            residuals[own], gradient[own] = surface.residuals(base[own])
            jacobian[own, 7 + 3 * index : 10 + 3 * index] = surface.jacobian(base[own], gradient[own])
        in_flange = np.einsum("nji,nj->ni", pose[:, :, :3], gradient)
        in_profiler = np.einsum("nji,nj->ni", turned, in_flange) @ x[:3, :3]
        jacobian[:, :3], jacobian[:, 3:6] = np.cross(self.points, in_profiler), in_profiler
        jacobian[:, 6] = np.sum(gradient * speed, axis=1)
        return residuals, jacobian, np.hstack([np.cross(flange, in_flange), in_flange])


def _rate(path: RobotPath, times_s: Array) -> Array:
    """Rates (k, 3, 4) per second of base_T_flange, within the path; exactly 0 where the arm stood."""
    if path.stands:
        return np.zeros((len(times_s), 3, 4))
    first, last = path.times_s[[0, -1]]
    start = np.clip(times_s - DIFFERENCE_S, first, max(first, last - 2 * DIFFERENCE_S))
    end = np.minimum(start + 2 * DIFFERENCE_S, last)
    rate: Array = (path.at(end, np.inf)[:, :3] - path.at(start, np.inf)[:, :3]) / (end - start)[:, None, None]
    return rate


def descend(problem: ProfilerProblem, estimate: ProfilerEstimate, iterations: int) -> tuple[ProfilerEstimate, float]:
    """Levenberg-Marquardt without errors of the robot, from far away; also the median distance in mm."""
    damping, (residuals, jacobian, _) = 1e-2, problem.rows(estimate)
    still = np.zeros_like(estimate.errors)
    for _ in range(iterations):
        weights = _robust_weights(residuals)
        information = (jacobian * weights[:, None]).T @ jacobian
        scale = np.diag(np.maximum(np.diag(information), 1e-9))
        step = -np.asarray(np.linalg.solve(information + damping * scale, jacobian.T @ (weights * residuals)), float)
        trial = estimate.after(step, still)
        after, after_jacobian, _ = problem.rows(trial)
        scale_mm = _scale(residuals)
        if np.log1p((after / scale_mm) ** 2).sum() <= np.log1p((residuals / scale_mm) ** 2).sum():
            estimate, residuals, jacobian, damping = trial, after, after_jacobian, damping / 10
            if np.abs(step[:7] / UNITS).max() < STEP_TOLERANCE:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    return estimate, float(np.median(np.abs(residuals)))


def refine(problem: ProfilerProblem, start: ProfilerEstimate, stated: RobotNoise = PRIOR_NOISE) -> ProfilerSolution:
    """Maximum likelihood with the robot's errors and noise levels, from nearby. Raises UndeterminedError."""
    estimate, robot, converged = start, stated, False
    for _ in range(MAX_ITERATIONS):
        problem.place_s(estimate.clock_offset_s)
        residuals, jacobian, by_errors = problem.rows(estimate)
        weights = _robust_weights(residuals)
        point_mm = _point_noise(residuals, weights, problem.sweep_of)
        normal = _NormalEquations.of(
            problem, estimate.errors, residuals, jacobian, by_errors, weights / point_mm**2, robot
        )
        step, errors, covariance, spread = normal.solve()
        _require_determined(covariance)
        estimate = estimate.after(step, errors)
        before, robot = robot, _robot_noise(estimate.errors, spread, stated)
        converged = bool(
            np.abs(step[:7] / UNITS).max() < 1e-3
            and abs(robot.translation_mm / before.translation_mm - 1) < NOISE_TOLERANCE
        )
        if converged:
            break
    squares = np.bincount(problem.sweep_of, weights * residuals**2) / np.bincount(problem.sweep_of, weights)
    return ProfilerSolution(estimate, covariance, point_mm, robot, np.sqrt(squares), converged)


@dataclass(frozen=True, eq=False)
class _NormalEquations:
    """Information and gradient by the shared unknowns (a,), by each sweep's error (n, 6), and between them."""

    shared: Array
    shared_gradient: Array
    own: Array
    own_gradient: Array
    between: Array

    @classmethod
    def of(
        cls, problem: ProfilerProblem, errors: Array, residuals: Array, jacobian: Array, by_errors: Array,
        weights: Array, robot: RobotNoise,
    ) -> "_NormalEquations":  # fmt: skip
        prior = np.repeat(1 / robot.levels() ** 2, 3)
        own, own_gradient, between = [], [], []
        for index, error in enumerate(errors):
            rows = problem.sweep_of == index
            weighted = by_errors[rows] * weights[rows, None]
            own.append(weighted.T @ by_errors[rows] + np.diag(prior))
            own_gradient.append(weighted.T @ residuals[rows] + prior * error)
            between.append(weighted.T @ jacobian[rows])
        weighted = jacobian * weights[:, None]
        return cls(
            weighted.T @ jacobian, weighted.T @ residuals, np.array(own), np.array(own_gradient), np.array(between)
        )

    def solve(self) -> tuple[Array, Array, Array, Array]:
        """Steps (a,) and (n, 6), covariance (7, 7) of X and offset, and those (n, 6, 6) of the sweeps' errors."""
        own = np.linalg.inv(self.own)
        carried = own @ self.between
        information = self.shared - np.einsum("nij,nik->jk", self.between, carried)
        if information[6, 6] < MIN_CLOCK_INFORMATION:  # no arm moves: nothing shows the clock, and it moves nothing
            information[6, 6] = 1 / UNITS[6] ** 2
        covariance = covariance_of((information + information.T) / 2)
        gradient = self.shared_gradient - np.einsum("nij,ni->j", carried, self.own_gradient)
        step = -covariance @ gradient
        errors = -np.einsum("nij,nj->ni", own, self.own_gradient + self.between @ step)
        spread = own + carried @ covariance @ np.swapaxes(carried, 1, 2)
        return step, errors, covariance[:7, :7], spread


def _scale(residuals: Array) -> float:
    return max(3 * 1.4826 * float(np.median(np.abs(residuals))), MIN_POINT_NOISE_MM)


def _robust_weights(residuals: Array) -> Array:
    """Cauchy's, by the median distance."""
    weights: Array = 1 / (1 + (residuals / _scale(residuals)) ** 2)
    return weights


def _point_noise(residuals: Array, weights: Array, sweep_of: NDArray[np.intp]) -> float:
    """Standard deviation in mm with which a point counts: of one, or more where neighbours share errors."""
    alone = float(np.sum(weights * residuals**2) / np.sum(weights))
    group = np.arange(len(residuals)) // NEIGHBOURS + (1 + len(residuals)) * sweep_of
    _, group = np.unique(group, return_inverse=True)
    together = np.bincount(group, weights * residuals) ** 2 / np.bincount(group, weights)
    return max(float(np.sqrt(max(alone, together.mean()))), MIN_POINT_NOISE_MM)


def _robot_noise(errors: Array, spread: Array, stated: RobotNoise) -> RobotNoise:
    """`stated` times a factor: the mean square of the errors and what is left uncertain of them."""
    variances = np.repeat(stated.levels() ** 2, 3)
    squares = (errors**2 + np.diagonal(spread, axis1=1, axis2=2)) / variances
    factor = np.sqrt((PRIOR_WEIGHT + squares.sum()) / (PRIOR_WEIGHT + squares.size))
    factor = max(factor, MIN_REPEATABILITY.translation_mm / stated.translation_mm)
    return RobotNoise(stated.translation_mm * factor, stated.rotation_rad * factor)


NAMES = ("rotation-x", "rotation-y", "rotation-z", "translation-x", "translation-y", "translation-z", "clock-offset")


def _require_determined(covariance: Array) -> None:
    """Raises UndeterminedError that names the unknowns which change in the directions that are not determined."""
    values, vectors = np.linalg.eigh(covariance / UNITS[:, None] / UNITS)
    free = np.sqrt(np.maximum(values, 0.0)) > MAX_SIGMA
    if not free.any():
        return
    shares = np.sum(vectors[:, free] ** 2, axis=1)
    names = [Sentence(f"profiler-{name}") for name, share in zip(NAMES, shares, strict=True) if share > MIN_SHARE]
    raise UndeterminedError("profiler-unobservable", Sentence("profiler-undetermined", free=names), FIX)
