"""The U that the views of a run were expected to leave, and why the one that was found is another."""

from dataclasses import dataclass
from math import degrees, isfinite

import numpy as np

from calibration.likelihood.predicted_uncertainty import ExpectedNoise, Scene, predict
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import NamedPoint, Solution, used_views

MAX_RATIO = 1.5
"""Of the U that was found to the expected one, and of the expected to the found, above which the reason is given."""

MIN_NOISE_RATIO = 1.25
"""Least ratio of a noise level that was found to the expected one for naming it as the reason."""

MIN_INFLATION = 1.5
"""Least factor of the covariance by views left out for naming that as the reason."""


@dataclass(frozen=True)
class Expectation:
    """U (k = 2, mm) at the worst of the points that matter, as expected; None where it is not known. `why`: of a U that
    was found to be more than MAX_RATIO times larger or smaller."""

    expanded_mm: float | None = None
    why: Sentence | None = None


NOTHING_EXPECTED = Expectation()


def expectation_of(
    problem: Problem, solution: Solution, noise: ExpectedNoise, points: tuple[NamedPoint, ...]
) -> Expectation:
    """What the views that were used were expected to leave, with the noise that was assumed before they were taken.

    `points`: where the uncertainty counts; the working volume without any.
    """
    x, y, camera = solution.mount_T_camera, solution.anchor_T_target, solution.camera
    if x is None or y is None or camera is None or solution.uncertainty is None or problem.in_space:
        return NOTHING_EXPECTED
    poses = np.array([view.base_T_flange for view in used_views(problem, solution)])
    free = solution.camera_source == "estimated" and problem.camera is None
    scene = Scene(problem.setup, problem.target, camera, x, y, noise, free, points, problem.knowledge, problem.camera)
    expected_mm = predict(scene, poses).worst_point.expanded_mm
    if not isfinite(expected_mm):
        return NOTHING_EXPECTED
    found_mm = solution.uncertainty.worst_point.expanded_mm
    if expected_mm / MAX_RATIO <= found_mm <= expected_mm * MAX_RATIO:
        return Expectation(expected_mm, None)
    reason = _reason(found_mm > expected_mm, solution, noise)
    why = Sentence("accuracy-unexpected", found_mm=found_mm, expected_mm=expected_mm, reason=reason)
    return Expectation(expected_mm, why)


def _reason(larger: bool, solution: Solution, noise: ExpectedNoise) -> Sentence:
    """The noise level that is furthest off in that direction, else errors that the noise does not explain."""
    found = solution.noise
    levels = (
        ("robot-mm", found.robot_translation_mm, noise.robot_translation_mm, float),
        ("robot-deg", found.robot_rotation_rad, noise.robot_rotation_rad, degrees),
        ("image-px", found.image_px, noise.image_px, float),
    )
    ratios = [
        (level / assumed if larger else assumed / max(level, 1e-12), name, unit(level), unit(assumed))
        for name, level, assumed, unit in levels
        if level is not None and assumed > 0
    ]
    ratio, name, level, assumed = max(ratios, default=(0.0, "", 0.0, 0.0))
    if ratio > MIN_NOISE_RATIO:
        return Sentence(f"accuracy-{name}", found=level, expected=assumed)
    if larger and solution.leave_out is not None and solution.leave_out.inflation > MIN_INFLATION:
        return Sentence("accuracy-left-out", times=solution.leave_out.inflation**0.5)
    return Sentence("accuracy-not-noise" if larger else "accuracy-less-counted")
