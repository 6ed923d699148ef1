"""What a calibration from clouds answers, as a Solution, and its verdict."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibration.closed_forms.observability import summarise_motion
from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import uncertainty_of
from calibration.problem import Setup
from calibration.sentences.sentence import Sentence
from calibration.solution import ClockOffsetDocument, Finding, Noise, Observability, Solution, ViewResult
from calibration.transforms import Array
from calibration.verdict import (
    CONTRADICTIONS,
    DEFAULT_VERDICT_LIMITS,
    Verdict,
    VerdictLimits,
    point_findings,
    rejection_findings,
    robot_findings,
    verdict_of,
)

FIX = Sentence("add-turned-views")


def solution_with_x(
    method: str,
    setup: Setup,
    mount_T_camera: Array,
    covariance: Array,
    seen_mm: Array,
    noise: Noise,
    views: Sequence[ViewResult],
    base_T_flange: Array,
    findings: tuple[Finding, ...] = (),
    clock_offset: ClockOffsetDocument | None = None,
) -> Solution:
    """A Solution with X and its covariance (6, 6), as in Uncertainty; `seen_mm` (n, 3): where X's points are used.

    `base_T_flange` (n, 4, 4): poses of the views used.
    """
    return Solution(
        setup=setup,
        method=method,
        mount_T_camera=mount_T_camera,
        uncertainty=uncertainty_of(covariance, mount_T_camera, seen_mm),
        noise=noise,
        views=tuple(views),
        observability=_observability(base_T_flange, _weakest(covariance, seen_mm)),
        findings=findings,
        clock_offset=clock_offset,
    )


def solution_without_x(
    method: str, setup: Setup, views: Sequence[ViewResult], base_T_flange: Array, error: UndeterminedError
) -> Solution:
    return Solution(
        setup=setup,
        method=method,
        views=tuple(views),
        observability=_observability(base_T_flange, "X"),
        findings=(Finding(error.code, "error", error.what, error.fix),),
    )


def _observability(base_T_flange: Array, weakest: str) -> Observability:
    motion = summarise_motion(base_T_flange)
    return Observability(len(base_T_flange), motion.max_rotation_rad, motion.axis_spread, weakest)


def _weakest(covariance: Array, seen_mm: Array) -> str:
    """The axis about or along which X displaces the measured points most."""
    reach = np.linalg.norm(seen_mm.mean(axis=0))
    deviations = np.sqrt(np.diagonal(covariance)) * np.repeat([reach, 1.0], 3)
    worst = int(np.argmax(deviations))
    return f"{'rotation about' if worst < 3 else 'translation along'} the camera's {'xyz'[worst % 3]}"


def judge_scan(solution: Solution, limits: VerdictLimits = DEFAULT_VERDICT_LIMITS) -> Verdict:
    """May X from clouds be used? The same limits and codes as with images; of the robot's noise its translation."""
    contradicting = sum(view.reason in CONTRADICTIONS for view in solution.views)
    noise = replace(solution.noise, robot_rotation_rad=None)
    findings = (
        *solution.findings,
        *point_findings(solution, limits, FIX),
        *robot_findings(noise, limits, Sentence("check-robot-scans")),
        *rejection_findings(
            contradicting, len(solution.views), limits, "many-rejected-scans", Sentence("check-poses-and-artefact")
        ),
    )
    return verdict_of(solution, findings, limits)
