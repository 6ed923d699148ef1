"""X from pairs of points: coordinates of a tip or a ball by the robot, and by a camera that measures in space.

The points in the mount's frame are the camera's moved by X. Least squares: K. Arun, T. Huang & S. Blostein, IEEE PAMI
9(5), 1987; the covariance follows from the residuals, which 3 n numbers less six leave, and Student's t of few of them
widens U.
"""

from collections.abc import Iterator

import numpy as np

from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import uncertainty_of
from calibration.linear_algebra import covariance_of
from calibration.problem import Setup
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR, Finding, Noise, Observability, Solution
from calibration.transforms import Array, map_points, nearest_rotation, skew, transform
from calibration.verdict import Verdict, VerdictLimits, point_findings, verdict_of

MIN_POINTS = 4
"""Three points always agree so well that their errors do not show."""

MIN_SPREAD = 0.02
"""Least ratio of the points' second extent to their first: points on a line leave a turn about it open."""

MAX_POSSIBLE_MM = 15.0
"""Largest scatter of points that both sides measured; more are wrong pairs, units or frames."""

T_95 = {6: 2.447, 9: 2.262, 12: 2.179, 18: 2.101, 30: 2.042}
"""Student's t at 95 % by the numbers to spare; beyond the last about two."""


def solve_point_pairs(setup: Setup, mount_points_mm: Array, camera_points_mm: Array) -> Solution:
    """X and its uncertainty from n points in the mount's frame and in the camera's (n, 3).

    Raises UndeterminedError for fewer than MIN_POINTS, or for points on a line.
    """
    n = len(camera_points_mm)
    about = camera_points_mm - camera_points_mm.mean(axis=0)
    there = mount_points_mm - mount_points_mm.mean(axis=0)
    if n < MIN_POINTS:
        raise UndeterminedError(
            "too-few-points", Sentence("too-few-point-pairs", points=n), Sentence("add-point-pairs")
        )
    extents = np.linalg.svd(about, compute_uv=False)
    if extents[1] < MIN_SPREAD * extents[0]:
        raise UndeterminedError("point-pairs-on-a-line", Sentence("point-pairs-on-a-line"), Sentence("add-point-pairs"))
    rotation, _ = nearest_rotation(there.T @ about)
    X = transform(rotation, mount_points_mm.mean(axis=0) - rotation @ camera_points_mm.mean(axis=0))
    residuals = mount_points_mm - map_points(X, camera_points_mm)
    spare = 3 * n - 6
    sigma_mm = float(np.sqrt(np.sum(residuals**2) / spare))
    slopes = np.concatenate([-skew(camera_points_mm), np.broadcast_to(np.eye(3), (n, 3, 3))], axis=2)
    widened = next((t for count, t in T_95.items() if spare <= count), COVERAGE_FACTOR) / COVERAGE_FACTOR
    covariance = (widened * max(sigma_mm, 1e-6)) ** 2 * covariance_of(
        np.sum(np.swapaxes(slopes, 1, 2) @ slopes, axis=0)
    )
    return Solution(
        setup=setup, method="point-pairs", mount_T_camera=X, anchor_T_target=np.eye(4),
        uncertainty=uncertainty_of(covariance, X, camera_points_mm), noise=Noise(None, None, sigma_mm), views=(),
        observability=Observability(n, 0.0, float(extents[1] / extents[0]), "turns about the line of the points"),
        findings=tuple(_findings(sigma_mm, n)),
    )  # fmt: skip


def _findings(sigma_mm: float, n: int) -> Iterator[Finding]:
    if sigma_mm > MAX_POSSIBLE_MM:
        message = Sentence("point-pairs-disagree", sigma_mm=sigma_mm)
        yield Finding("point-pairs-disagree", "error", message, Sentence("compare-point-pairs"))
    else:
        message = Sentence("point-pairs-noise", points=n, sigma_mm=sigma_mm)
        yield Finding("point-pairs-noise", "info", message, Sentence("none-needed"))


def judge_point_pairs(solution: Solution, limits: VerdictLimits) -> Verdict:
    """The verdict of a solution of point pairs, with a finding on its uncertainty."""
    findings = (*solution.findings, *point_findings(solution, limits, Sentence("add-point-pairs")))
    return verdict_of(solution, findings, limits)
