"""Calibration from scans of one sphere, with the same Solution as from images."""

from collections.abc import Sequence

import numpy as np

from calibration.closed_forms.observability import require_observable
from calibration.errors import UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, Noise, Solution, ViewResult
from calibration.transforms import Array, map_points
from registration.calibrate.outcome import solution_with_x, solution_without_x
from registration.calibrate.sphere_solver import SphereSolution, solve_from_sphere
from registration.errors import SphereError
from registration.points.sphere_fit import find_artefact
from registration.scan import ScanView, sample_views, setup_of

METHOD = "sphere of known radius"


def solve_sphere_scan(views: Sequence[ScanView], radius_mm: float) -> Solution:
    """X from views of one sphere that stands, or with a standing camera is on the flange.

    `mount_T_camera` is None when they do not determine it.
    A view without the sphere is rejected with a reason. Raises CloudError's leaves, UnitUnknown, ScanError.
    """
    centres: dict[int, Array] = {}
    reasons: dict[int, str] = {}
    for index, sample in enumerate(sample_views(views)):
        try:
            centres[index] = find_artefact(sample.surface.points, radius_mm).centre
        except SphereError as error:
            reasons[index] = f"sphere-not-found: {error}"
    found = list(centres)
    poses = np.array([views[index].base_T_flange for index in found]).reshape(-1, 4, 4)
    try:
        require_observable(poses)
        seen, mounts = [centres[index] for index in found], [views[index].anchor_T_mount for index in found]
        answer = solve_from_sphere(np.array(seen), np.array(mounts))
    except UndeterminedError as error:
        why = [reasons.get(index, error.code) for index in range(len(views))]
        results = [ViewResult(index, None, "rejected", reason) for index, reason in enumerate(why)]
        return solution_without_x(METHOD, setup_of(views), results, poses, error)
    return _solution(views, found, centres, reasons, answer)


def _solution(
    views: Sequence[ScanView],
    found: Sequence[int],
    centres: dict[int, Array],
    reasons: dict[int, str],
    answer: SphereSolution,
) -> Solution:
    used = [found[row] for row in answer.used]
    x = answer.mount_T_camera
    off = {
        index: map_points(views[index].anchor_T_mount @ x, centres[index][None])[0] - answer.anchor_centre_mm
        for index in found
    }
    left_out = {} if answer.left_out_mm is None else dict(zip(used, answer.left_out_mm.tolist(), strict=True))
    results = list[ViewResult]()
    for index in range(len(views)):
        is_used, away_mm, reason = index in used, None, reasons.get(index, "pose-disagrees")
        if index in centres:  # from where the other views put the sphere's centre
            away_mm = left_out.get(index, float(np.linalg.norm(off[index])))
        how = None if is_used else reason
        results.append(ViewResult(index, None, "used" if is_used else "rejected", how, None, away_mm, None))
    x_mm, y_mm, z_mm = answer.anchor_centre_mm
    at = Finding(
        "sphere-centre",
        "info",
        Sentence(
            "sphere-centre" if setup_of(views) == "eye-in-hand" else "sphere-centre-on-flange",
            x_mm=x_mm,
            y_mm=y_mm,
            z_mm=z_mm,
            x_spread_mm=answer.spread_mm[0],
            y_spread_mm=answer.spread_mm[1],
            z_spread_mm=answer.spread_mm[2],
        ),
        Sentence("touch-sphere"),
    )
    return solution_with_x(
        METHOD,
        setup_of(views),
        x,
        answer.covariance,
        np.array([centres[index] for index in used]),
        Noise(None, None, answer.sigma_mm),
        results,
        np.array([views[index].base_T_flange for index in used]),
        (at,),
    )
