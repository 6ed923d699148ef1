"""Solution by a named closed form instead of maximum likelihood, with its own uncertainty by simulation."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.observability import require_observable
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.errors import GeometryError, UndeterminedError
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate
from calibration.likelihood.leave_out import base_errors
from calibration.linear_algebra import covariance_of
from calibration.observations.reprojection import pixel_residuals, pixel_statistics
from calibration.observations.view_poses import apply_pose_steps, refine_poses
from calibration.preprocessing.prepare import PreparedSession
from calibration.problem import anchor_T_mount_of
from calibration.sentences.sentence import Sentence
from calibration.solution import HoldOutDocument
from calibration.solver.initial_guess import chain_from_mount
from calibration.solver.view_outliers import Selection
from calibration.transforms import Array, inverse, transform_from_vector, vector_from_transform

THREE_POSE = "three-pose"
DRAWS_TIMES_VIEWS, MIN_DRAWS, MAX_DRAWS = 3000, 16, 100
"""Draws of the simulation: the relative error of a variance is sqrt(2 / draws); fewer for many views, for speed."""

MAX_HELD_OUT_VIEWS = 30
SEED = 1


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """`selection.best` with the closed form's chain; `covariance` (6, 6) of X by simulation at the estimated noise."""

    selection: Selection
    covariance: Array
    hold_out: HoldOutDocument | None


def solve_closed_form(prepared: PreparedSession, selection: Selection, method: str) -> ClosedForm:
    """The method on the views that agree; three-pose on the first three of them. Raises UndeterminedError."""
    used = selection.used.copy()
    if method == THREE_POSE:
        used[np.flatnonzero(used)[3:]] = False
        require_observable(prepared.seen.base_T_flange[used])
    best = selection.best
    rows = _at(prepared.take(used), best)
    chain = _solve_chain(rows, method)
    covariance = _covariance(rows, best, chain, method)
    held_out = _hold_out(rows, best, method) if len(rows.seen) > 3 else None
    return ClosedForm(Selection(used, replace(best, chain=chain)), covariance, held_out)


def _at(rows: PreparedSession, best: Estimate) -> PreparedSession:
    """The session at the estimated camera and target scale, with the poses refined."""
    seen = best.seen(rows.seen)
    return replace(
        rows, seen=seen, camera=best.camera, camera_T_target=refine_poses(seen, best.camera, rows.camera_T_target)
    )


def _solve_chain(rows: PreparedSession, method: str) -> Chain:
    try:
        mount_T_camera = CLOSED_FORMS[method](rows.anchor_T_mount, rows.camera_T_target)
    except GeometryError as error:
        raise UndeterminedError(f"{method}-failed", str(error), Sentence("use-auto-or-other-poses")) from None
    return chain_from_mount(rows, mount_T_camera)


def _covariance(rows: PreparedSession, best: Estimate, chain: Chain, method: str) -> Array:
    """Scatter of the method's X when the views' own poses and the robot's are drawn anew from the estimated noise."""
    rng = np.random.default_rng(SEED)
    n = len(rows.seen)
    by_pixels = covariance_of(pixel_statistics(rows.seen, rows.camera, rows.camera_T_target).normal)
    image = np.linalg.cholesky(best.variances.pixel * by_pixels)
    robot = best.variances.deviations()
    exact = chain.without_corrections().camera_T_target()
    draws = int(np.clip(DRAWS_TIMES_VIEWS // n, MIN_DRAWS, MAX_DRAWS))
    steps = []
    for _ in range(draws):
        poses = apply_pose_steps(exact, (image @ rng.standard_normal((n, 6, 1)))[..., 0])
        base_T_flange = rows.seen.base_T_flange @ transform_from_vector(robot * rng.standard_normal((n, 6)))
        anchor_T_mount = anchor_T_mount_of(rows.setup, base_T_flange)
        step = inverse(chain.mount_T_camera) @ CLOSED_FORMS[method](anchor_T_mount, poses)
        steps.append(vector_from_transform(step))
    return np.cov(np.array(steps).T)


def _hold_out(rows: PreparedSession, best: Estimate, method: str) -> HoldOutDocument:
    """Cross-validation: at most thirty views are left out in turn and predicted by the method's X of the others."""
    n = len(rows.seen)
    distances: list[Array] = []
    pixels: list[Array] = []
    for row in np.unique(np.linspace(0, n - 1, min(n, MAX_HELD_OUT_VIEWS)).astype(np.intp)):
        chain = _solve_chain(rows.take(np.delete(np.arange(n), row)), method)
        view = rows.take(np.array([row]))
        there = Chain(
            chain.setup, view.seen.base_T_flange, chain.mount_T_camera, chain.anchor_T_target, np.zeros((1, 6))
        )
        used: NDArray[np.bool_] = view.seen.weights[0] > 0
        distances.append(np.sum(base_errors(view.seen, there, view.camera_T_target)[0][used] ** 2, axis=-1))
        residuals = pixel_residuals(view.seen, best.camera, there.camera_T_target())[0][used]
        pixels.append(np.sum(residuals**2, axis=-1))
    return HoldOutDocument(*(float(np.sqrt(np.mean(np.concatenate(squares)))) for squares in (distances, pixels)))
