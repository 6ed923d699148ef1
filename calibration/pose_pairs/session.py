"""Calibration of a session whose views measure the target in space: poses, or points reduced to poses."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import require_observable, summarise_motion
from calibration.errors import UndeterminedError
from calibration.likelihood.predicted_uncertainty import observability_of, uncertainty_of
from calibration.linear_algebra import covariance_of
from calibration.observations.measured_poses import MeasuredViews, measured_views, unusable_views
from calibration.observations.observations import UnusableReason
from calibration.pose_pairs.alike_errors import with_alike_errors
from calibration.pose_pairs.independent_noise import PoseFit, information_of
from calibration.pose_pairs.length_scale import LengthPrior, require_units, with_lengths
from calibration.pose_pairs.noise_models import RANDOM_WALK, sources_of
from calibration.pose_pairs.noise_priors import LEVEL_PRIORS
from calibration.pose_pairs.residuals import LinearisedPairs, PosePairs, linearise
from calibration.pose_pairs.session_findings import session_findings
from calibration.pose_pairs.solve import fit_pose_pairs
from calibration.problem import Problem
from calibration.solution import Finding, HoldOutDocument, Noise, Observability, Solution, ViewResult
from calibration.transforms import Array, map_points, skew

MIN_HOLD_OUT_VIEWS = 4
MAX_LEVEL_FACTOR = 5.0
"""Largest noise of the camera that the diagnosis takes for granted, over the prior's median."""


@dataclass(frozen=True, eq=False)
class MeasuredSolution:
    """The solution of a session measured in space and its usable views (None where their unit is wrong).

    seen : with the camera's lengths corrected.
    covariance : (n, 6, 6) of the camera's poses of the target in the usable views, as of MeasuredViews.
    drifting : whether the camera's errors add up from view to view.
    """

    solution: Solution
    seen: MeasuredViews | None
    covariance: Array
    drifting: bool = False


def solve_measured_session(problem: Problem) -> MeasuredSolution:
    """X, the target's pose and their uncertainty from the poses or points of the views.

    Raises UndeterminedError when the views do not determine X or are in another unit.
    """
    seen, refused = measured_views(problem)
    require_observable(seen.base_T_flange)
    pairs = PosePairs(problem.setup, seen.base_T_flange, seen.camera_T_target, covariance=seen.covariance)
    require_units(pairs)
    fitted, used = fit_pose_pairs(pairs)
    fitted = with_lengths(pairs, fitted, used, LengthPrior.about(seen, problem.knowledge))
    fitted = with_alike_errors(pairs.take(used), fitted)
    at = linearise(pairs, fitted.chain)
    fit = _Residuals(pairs, at, information_of(at, fitted), used, fitted, problem.target.points_mm)
    metric = linearise(pairs, replace(fitted.chain, scale=1.0, depth=1.0)).predicted
    return MeasuredSolution(
        _solution(problem, seen, refused, fit),
        replace(seen, camera_T_target=seen.camera_T_target + metric - at.predicted),
        camera_covariance(at, fitted.camera, fitted.variances),
        fitted.camera == RANDOM_WALK,
    )


def camera_covariance(at: LinearisedPairs, camera: str, variances: dict[str, float]) -> Array:
    """(n, 6, 6) of the camera's errors, each level at most MAX_LEVEL_FACTOR times its prior.

    A level that absorbs a contradiction would hide it from the diagnosis.
    """
    total = at.floor.copy()
    for name, directions in sources_of(at, camera).items():
        if name not in LEVEL_PRIORS or not name.startswith("camera"):
            continue
        prior = LEVEL_PRIORS[name]
        usual = prior.level * (1.0 if prior.relative_to is None else LEVEL_PRIORS[prior.relative_to].level)
        total += min(variances[name], (MAX_LEVEL_FACTOR * usual) ** 2) * (directions @ np.swapaxes(directions, 1, 2))
    return total


@dataclass(frozen=True, eq=False)
class _Residuals:
    """All views at the estimate: residuals with their information (n, 6, 6), and the mask of those `used` (n,)."""

    pairs: PosePairs
    at: LinearisedPairs
    information: Array
    used: NDArray[np.bool_]
    fitted: PoseFit
    target_mm: Array

    def left_out(self) -> Array:
        """Residuals (n, 6) of each used view predicted by the others."""
        slopes = self.at.by_shared
        weighted = np.swapaxes(slopes, 1, 2) @ self.information
        normals, gradients = weighted @ slopes, (weighted @ self.at.residuals[..., None])[..., 0]
        normal, gradient = normals[self.used].sum(axis=0), gradients[self.used].sum(axis=0)
        steps = -(covariance_of(normal - normals) @ (gradient - gradients)[..., None])
        predicted: Array = self.at.residuals + (slopes @ steps)[..., 0]
        return predicted[self.used]

    def base_errors_mm(self, residuals: Array, views: NDArray[np.bool_]) -> Array:
        """RMS distance (n,) over the target's points by residuals [rotation rad, translation mm] of these views."""
        arms = self.target_mm @ np.swapaxes(self.at.predicted[views, :3, :3], 1, 2)
        shifts = residuals[:, None, 3:] / self.at.scale - (skew(arms) @ residuals[:, None, :3, None])[..., 0]
        errors: Array = np.sqrt(np.mean(np.sum(shifts**2, axis=-1), axis=1))
        return errors

    def points_mm(self) -> Array:
        """The target's points in the camera (k, 3), in all used views."""
        metric = self.at.predicted[self.used].copy()
        metric[:, :3, 3] /= self.at.scale
        return np.concatenate([map_points(pose, self.target_mm) for pose in metric])


def _solution(problem: Problem, seen: MeasuredViews, refused: dict[int, UnusableReason], fit: _Residuals) -> Solution:
    chain, covariance = fit.fitted.chain, fit.fitted.covariance[:6, :6]
    levels = fit.fitted.variances
    return Solution(
        setup=problem.setup,
        method="auto",
        mount_T_camera=chain.mount_T_camera,
        anchor_T_target=chain.anchor_T_target,
        uncertainty=replace(
            uncertainty_of(covariance, chain.mount_T_camera, fit.points_mm()), arm_scale=fit.fitted.arm_scale
        ),
        noise=Noise(None, float(np.sqrt(levels["robot rotation"])), float(np.sqrt(levels["robot translation"]))),
        views=_views(problem, seen, refused, fit),
        observability=observability_of(problem.setup, seen.base_T_flange[fit.used], chain.mount_T_camera, covariance),
        hold_out=_hold_out(fit),
        findings=session_findings(problem, seen, refused, fit.used, fit.fitted),
    )


def _hold_out(fit: _Residuals) -> HoldOutDocument | None:
    if np.count_nonzero(fit.used) < MIN_HOLD_OUT_VIEWS:
        return None
    errors = fit.base_errors_mm(fit.left_out(), fit.used)
    return HoldOutDocument(float(np.sqrt(np.mean(errors**2))), None)


def _views(
    problem: Problem, seen: MeasuredViews, refused: dict[int, UnusableReason], fit: _Residuals
) -> tuple[ViewResult, ...]:
    everything = np.ones(len(seen), bool)
    errors = fit.base_errors_mm(fit.at.residuals, everything)
    results = [unused_view(problem, position, why.code) for position, why in refused.items()]
    for row, position in enumerate(seen.positions):
        view, agrees = problem.views[position], bool(fit.used[row])
        status, reason = ("used", None) if agrees else ("rejected", "pose-disagrees")
        results.append(ViewResult(view.index, view.image, status, reason, None, float(errors[row]), None))  # type: ignore[arg-type]
    return tuple(sorted(results, key=lambda result: result.index))


def unused_view(problem: Problem, position: int, reason: str) -> ViewResult:
    """A view that is not part of the solution."""
    view = problem.views[position]
    return ViewResult(view.index, view.image, "rejected", reason)


def measured_without_x(problem: Problem, why: UndeterminedError) -> MeasuredSolution:
    """A solution without X of a session measured in space, with the reason; of noise what is usual is assumed."""
    try:
        seen, _ = measured_views(problem)
        require_units(PosePairs(problem.setup, seen.base_T_flange, seen.camera_T_target))
    except UndeterminedError:
        return MeasuredSolution(_without_x(problem, why), None, np.zeros((0, 6, 6)))
    return MeasuredSolution(_without_x(problem, why), seen, covariance_or_usual(seen))


def covariance_or_usual(seen: MeasuredViews) -> Array:
    """Of the views (n, 6, 6): as stated, else of noise that is usual."""
    if seen.covariance is not None:
        return seen.covariance
    rotation_rad, translation_mm = (LEVEL_PRIORS[name].level for name in ("camera rotation", "camera lateral"))
    return np.tile(np.diag(np.repeat([rotation_rad, translation_mm], 3) ** 2), (len(seen), 1, 1))


def _without_x(problem: Problem, why: UndeterminedError) -> Solution:
    refused = unusable_views(problem)
    usable = [view.base_T_flange for position, view in enumerate(problem.views) if position not in refused]
    motion = summarise_motion(np.array(usable).reshape(-1, 4, 4))
    views = [
        unused_view(problem, position, refused[position].code)
        if position in refused
        else ViewResult(view.index, view.image, "used")
        for position, view in enumerate(problem.views)
    ]
    return Solution(
        setup=problem.setup,
        method="auto",
        views=tuple(views),
        observability=Observability(len(usable), motion.max_rotation_rad, motion.axis_spread, why.what),
        findings=(Finding(why.code, "error", why.what, why.fix),),
    )
