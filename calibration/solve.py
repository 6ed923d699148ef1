"""From a calibration session to X: `solve_hand_eye(problem) -> Solution`, pure and never raising for bad data."""

import numpy as np

from calibration.camera import CameraModel
from calibration.closed_forms.registry import CLOSED_FORMS
from calibration.errors import UndeterminedError
from calibration.hold_out import base_errors, hold_out
from calibration.likelihood.chain import Chain
from calibration.likelihood.estimate import Estimate, estimate
from calibration.likelihood.mixed_model import Variances
from calibration.likelihood.pixels import pixel_residuals, pixel_statistics
from calibration.observability import Motion, axis_in_words, motion_of, require_determined
from calibration.observations import Observations, Unusable, observe
from calibration.problem import Problem
from calibration.solution import Finding, Noise, Observability, Solution, ViewResult
from calibration.starting_camera import starting_camera
from calibration.transforms import Array, inverse, map_points
from calibration.uncertainty import uncertainty_of
from calibration.view_poses import candidate_poses

METHODS = ("auto", *CLOSED_FORMS)


def solve_hand_eye(problem: Problem, method: str = "auto") -> Solution:
    """X, the target's pose, their uncertainty and what was found wrong with the input.

    `method`: "auto" (maximum likelihood) or a closed form's name. `Solution.mount_T_camera` is None, and a finding
    of severity "error" says why, when the session cannot determine X. Raises ValueError for an unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}: one of {', '.join(METHODS)}")
    seen, refused = observe(problem)
    motion = motion_of(seen.base_T_flange)
    try:
        require_determined(motion, problem.setup, seen.base_T_flange)
    except UndeterminedError as undetermined:
        return _refused(problem, method, motion, seen, refused, undetermined)
    camera = problem.camera or starting_camera(seen, problem.image_size)
    poses = candidate_poses(seen, camera)[0][:, 0]
    best = _best(problem, seen, camera, poses)
    return _solution(problem, method, motion, seen, refused, best, poses)


def _best(problem: Problem, seen: Observations, camera: CameraModel, poses: Array) -> Estimate:
    start = closed_form_chain(problem, seen, poses, "kronecker")
    statistics = pixel_statistics(seen, camera, poses)
    pixel = statistics.square.sum() / max(float(statistics.count.sum()) - 6 * len(seen), 1.0)
    rotation, translation = np.mean(start.corrections[:, :3] ** 2), np.mean(start.corrections[:, 3:] ** 2)
    variances = Variances(max(float(pixel), 1e-8), float(rotation), float(translation))
    return estimate(seen, camera, start, variances, free_intrinsics=problem.camera is None)


def closed_form_chain(problem: Problem, seen: Observations, poses: Array, method: str) -> Chain:
    """X by a closed form, the target's pose as its views have it, and the corrections that explain the rest."""
    base_T_flange = seen.base_T_flange
    anchor_T_mount = base_T_flange if problem.setup == "eye-in-hand" else inverse(base_T_flange)
    mount_T_camera = CLOSED_FORMS[method](anchor_T_mount, poses)
    anchor_T_target = (anchor_T_mount @ mount_T_camera @ poses)[0]
    empty = np.zeros((len(seen), 6))
    return Chain(problem.setup, base_T_flange, mount_T_camera, anchor_T_target, empty).with_corrections_from(poses)


def _solution(
    problem: Problem,
    method: str,
    motion: Motion,
    seen: Observations,
    refused: dict[int, Unusable],
    best: Estimate,
    poses: Array,
) -> Solution:
    chain = best.chain
    centre = problem.target.points_mm.mean(axis=0, keepdims=True)
    distance_mm = float(np.median(np.linalg.norm(map_points(poses, centre), axis=-1)))
    covariance = best.step.covariance[:6, :6]
    weakest = np.linalg.eigh(covariance[3:, 3:])[1][:, -1]
    direction = (chain.mount_T_camera[:3, :3] @ weakest) if problem.setup == "eye-in-hand" else weakest
    observability = Observability(
        len(seen),
        motion.max_rotation_rad,
        motion.axis_spread,
        f"translation along {axis_in_words(direction, seen.base_T_flange)}",
    )
    variances = best.variances
    return Solution(
        setup=problem.setup,
        method=method,
        mount_T_camera=chain.mount_T_camera,
        anchor_T_target=chain.anchor_T_target,
        camera=best.camera,
        camera_source="given" if problem.camera else "estimated",
        uncertainty=uncertainty_of(covariance, chain.mount_T_camera, best.camera, distance_mm),
        noise=Noise(
            float(np.sqrt(variances.pixel)),
            float(np.sqrt(variances.rotation)),
            float(np.sqrt(variances.translation)),
        ),
        views=_view_results(problem, seen, refused, best, poses),
        observability=observability,
        hold_out=hold_out(seen, best, poses),
    )


def _view_results(
    problem: Problem, seen: Observations, refused: dict[int, Unusable], best: Estimate, poses: Array
) -> tuple[ViewResult, ...]:
    reported = Chain(
        problem.setup,
        seen.base_T_flange,
        best.chain.mount_T_camera,
        best.chain.anchor_T_target,
        np.zeros_like(best.chain.corrections),
    )
    residuals = pixel_residuals(seen, best.camera, best.chain.camera_T_target())
    errors = base_errors(seen, reported, poses)
    results = [
        ViewResult(problem.views[p].index, problem.views[p].image, "rejected", why.code, None, None, None)
        for p, why in refused.items()
    ]
    for row, position in enumerate(seen.positions):
        weights = seen.weights[row] / seen.weights[row].sum()
        view = problem.views[position]
        results.append(
            ViewResult(
                index=view.index,
                image=view.image,
                status="used",
                reason=None,
                reprojection_px=float(np.sqrt(weights @ np.sum(residuals[row] ** 2, axis=-1))),
                base_error_mm=float(np.sqrt(weights @ np.sum(errors[row] ** 2, axis=-1))),
                robot_correction=(best.chain.corrections[row, 3:], best.chain.corrections[row, :3]),
            )
        )
    return tuple(sorted(results, key=lambda result: result.index))


def _refused(
    problem: Problem,
    method: str,
    motion: Motion,
    seen: Observations,
    refused: dict[int, Unusable],
    why: UndeterminedError,
) -> Solution:
    views = tuple(
        ViewResult(
            view.index,
            view.image,
            "rejected" if p in refused else "used",
            refused[p].code if p in refused else None,
            None,
            None,
            None,
        )
        for p, view in enumerate(problem.views)
    )
    return Solution(
        setup=problem.setup,
        method=method,
        mount_T_camera=None,
        anchor_T_target=None,
        camera=problem.camera,
        camera_source="given" if problem.camera else "estimated",
        uncertainty=None,
        noise=Noise(None, None, None),
        views=views,
        observability=Observability(len(seen), motion.max_rotation_rad, motion.axis_spread, why.what),
        hold_out=None,
        findings=(Finding(why.code, "error", why.what, why.fix),),
    )
