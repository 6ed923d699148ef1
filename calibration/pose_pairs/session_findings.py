"""Findings on a session whose views measure the target in space."""

from collections.abc import Iterator
from math import degrees

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import distinct_stations
from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE, PRIOR_NOISE
from calibration.observations.measured_poses import MeasuredViews
from calibration.observations.observations import UnusableReason
from calibration.pose_pairs.independent_noise import PoseFit
from calibration.pose_pairs.noise_marginalisation import MAX_VIEWS
from calibration.pose_pairs.noise_models import GIVEN
from calibration.problem import Problem
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding

CAMERA_TURNS, CAMERA_SHIFTS = ("camera rotation", "camera roll"), ("camera lateral", "camera depth")


def session_findings(
    problem: Problem,
    seen: MeasuredViews,
    refused: dict[int, UnusableReason],
    used: NDArray[np.bool_],
    fitted: PoseFit,
) -> tuple[Finding, ...]:
    """The findings, in the order of the solver's steps; `used` (n,): the views of `seen` that agree."""
    return (
        *_unusable(problem, refused),
        *_points(seen),
        *_poses(problem, seen, used),
        *_lengths(fitted),
        *_noise(seen, fitted, int(used.sum())),
    )


def contradicts(fitted: PoseFit) -> bool:
    """Whether robot and camera disagree by more than any of the two can err.

    This decides what explains the data, as in the diagnosis, so it is the bound of what robots can do. Whether the
    answer is accepted is decided by the user's limits (`VerdictLimits.possible_...`), in the verdict.
    """
    return any(
        _largest_level(fitted, shifts) > MAX_POSSIBLE_NOISE.translation_mm
        or _largest_level(fitted, turns) > MAX_POSSIBLE_NOISE.rotation_rad
        for turns, shifts in ((("robot rotation",), ("robot translation",)), (CAMERA_TURNS, CAMERA_SHIFTS))
    )


def _largest_level(fitted: PoseFit, sources: tuple[str, ...]) -> float:
    return float(np.sqrt(max((fitted.variances.get(name, 0.0) for name in sources), default=0.0)))


def _unusable(problem: Problem, refused: dict[int, UnusableReason]) -> Iterator[Finding]:
    by_reason: dict[tuple[str, str], list[int]] = {}
    for position, why in sorted(refused.items()):
        by_reason.setdefault((why.code, why.what), []).append(problem.views[position].index)
    for (code, what), indices in by_reason.items():
        message = Sentence("views-not-used", views=indices, why=what)
        yield Finding(code, "info", message, Sentence("correct-views"))


def _points(seen: MeasuredViews) -> Iterator[Finding]:
    if seen.points_mm is None:
        return
    across_mm, along_mm = seen.points_mm.tolist()
    message = Sentence("points-noise", across_mm=across_mm, along_mm=along_mm)
    yield Finding("points-noise", "info", message, Sentence("none-needed"))
    if seen.left_out:
        message = Sentence("points-left-out", points=seen.left_out)
        yield Finding("points-left-out", "info", message, Sentence("look-for-reflections"))
    message = Sentence("points-size", ratio=seen.size_ratio)
    sizes = (("points_size_share", seen.size_ratio - 1),)
    yield Finding("points-size", "warning", message, Sentence("measure-pitch-and-lengths"), sizes=sizes, within="info")


def _poses(problem: Problem, seen: MeasuredViews, used: NDArray[np.bool_]) -> Iterator[Finding]:
    if not np.all(used):
        indices = [problem.views[position].index for position in seen.positions[~used]]
        message = Sentence("measured-pose-disagrees", views=indices)
        yield Finding("pose-disagrees", "warning", message, Sentence("check-these-poses"))
    if repeated := sorted(set(range(len(seen))) - set(distinct_stations(seen.base_T_flange))):
        indices = [problem.views[position].index for position in seen.positions[repeated]]
        message = Sentence("duplicate-poses", views=indices)
        yield Finding("duplicate-poses", "warning", message, Sentence("use-each-pose-once"))


def _lengths(fitted: PoseFit) -> Iterator[Finding]:
    if fitted.off[-1] and len(fitted.off) > 1:
        message = Sentence("focal-length-off", percent=100 * (1 / fitted.chain.depth - 1))
        yield Finding("focal-length-off", "warning", message, Sentence("calibrate-camera-in-focus"))
    if not fitted.off[0]:
        return
    share = fitted.chain.scale - 1
    message = Sentence("lengths-longer" if share > 0 else "lengths-shorter", percent=100 * abs(share))
    yield Finding("camera-scale", "error", message, Sentence("check-lengths"), sizes=(("points_size_share", share),))


def _noise(seen: MeasuredViews, fitted: PoseFit, used: int) -> Iterator[Finding]:
    turn_rad, shift_mm = (_largest_level(fitted, of) for of in (CAMERA_TURNS, CAMERA_SHIFTS))
    if fitted.camera != GIVEN:
        name = "camera-noise" if seen.covariance is None else "camera-noise-beyond"
        message = Sentence(name, translation_mm=shift_mm, rotation_deg=degrees(turn_rad))
        sizes = (("possible_translation_mm", shift_mm), ("possible_rotation_rad", turn_rad))
        yield Finding("camera-noise", "error", message, Sentence("check-camera-poses"), sizes=sizes, within="info")
    if used <= MAX_VIEWS:
        message = Sentence(
            "noises-assumed",
            views=used,
            translation_mm=PRIOR_NOISE.translation_mm,
            rotation_deg=degrees(PRIOR_NOISE.rotation_rad),
        )
        yield Finding("noise-assumed", "info", message, Sentence("take-more-than", views=MAX_VIEWS))
