"""Rare effects that differ from view to view: a lens that refocuses, and glass before the target.

To first order each looks like a size of the target and another place of the camera or of the target, so that pictures
alone seldom show it, and robot and pictures together do. One is adopted where it is likelier than not, and widens the
uncertainty by its probability where it is not.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.estimate import exact_pixels, linearise
from calibration.likelihood.mixed_model import MixedModel, Variances, solve
from calibration.likelihood.noise_marginalisation import Marginal, marginalise
from calibration.likelihood.variance_components import estimate_variances
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.view_outliers import Selection, select_views
from calibration.transforms import Array, inverse, map_points

MIN_SIGMAS = 1.5
"""Least size of an effect in its standard deviations; of a smaller one the evidence is not asked."""

GLASS_INDEX = 1.5
"""Index of refraction of glass and of acrylic."""


def refocusing(camera: CameraModel, camera_T_target: Array, points_mm: Array) -> Array:
    """What a focal length f (1 + b / distance) does with b = 1 mm, the mean over the views being as described.

    As a thin lens of focal length b does by autofocus.
    """
    there = map_points(camera_T_target, points_mm)
    nearness = 1 / there[..., 2].mean(axis=1)
    x, y = there[..., 0] / there[..., 2], there[..., 1] / there[..., 2]
    along, across = camera.lens.distort(x, y)
    xx, xy, yx, yy = camera.lens.slopes(x, y)
    moved = np.stack([yy * along - xy * across, xx * across - yx * along, 0 * x], axis=-1)
    moved *= (there[..., 2] * (nearness - nearness.mean())[:, None] / (xx * yy - xy * yx))[..., None]
    return np.asarray(moved @ camera_T_target[:, :3, :3])


def glass(camera: CameraModel, camera_T_target: Array, points_mm: Array) -> Array:
    """By how much points below glass of 1 mm seem to rise from the target: more, the more obliquely they are seen."""
    to_camera = inverse(camera_T_target)[:, None, :3, 3] - points_mm
    cosine = to_camera[..., 2] / np.linalg.norm(to_camera, axis=-1)
    rise = np.sign(cosine) - cosine / np.sqrt(GLASS_INDEX**2 - 1 + cosine**2)
    return np.asarray(rise[..., None] * [0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Kind:
    """A kind of effect by the `code` and `fix` of its finding: its prior `probability`, and its size if it is there."""

    code: str
    fix: str
    probability: float
    sigma_mm: float
    moved: Callable[[CameraModel, Array, Array], Array]
    """By a camera, poses camera_T_target (n, 4, 4) and points (n, m, 3): their displacements, on the target."""


KINDS = (
    Kind("lens-refocuses", "switch-autofocus-off", 0.05, 20.0, refocusing),
    Kind("target-below-glass", "uncover-target", 0.05, 5.0, glass),
)


@dataclass(frozen=True, eq=False)
class Effect:
    """What a session says of an effect: its `probability`, and `prepared` with it as the last unknown.

    `more` (12, 12): what it adds to the covariance of X and the target's pose where it is not adopted.
    """

    prepared: PreparedSession
    probability: float
    more: Array


def take_up_effects(prepared: PreparedSession, selection: Selection) -> tuple[PreparedSession, Selection, Array]:
    """The session and its estimate with the effects that are likelier than not.

    And what the others add to the covariance (12, 12) of X and the target's pose, by their probability.
    """
    while (found := _find_effects(prepared, selection)) and found[0].probability > 0.5:
        best, prepared = selection.best, found[0].prepared
        selection = select_views(prepared, selection.used, best.chain, best.variances, np.append(best.z, 0.0))
    return prepared, selection, np.sum([effect.more for effect in found], axis=0, initial=0.0)


def _find_effects(prepared: PreparedSession, selection: Selection) -> list[Effect]:
    """Those that are not among the unknowns and of which the views say more than a little, the likeliest first."""
    best, used, found = selection.best, selection.used, list[Effect]()
    fixed: Marginal | None = None

    def model_of(session: PreparedSession, z: Array) -> tuple[MixedModel, Variances]:
        pixels = exact_pixels(session.seen.take(used), session.nuisances)
        model = linearise(pixels, best.chain, session.nuisances, z)
        return model, estimate_variances(model, best.variances)

    for kind in KINDS:
        if kind.code in prepared.nuisances.effects:
            continue
        moved = kind.moved(best.camera, prepared.camera_T_target, prepared.seen.points_mm)[..., None]
        session = replace(
            prepared,
            nuisances=prepared.nuisances.with_effect(kind.code, kind.sigma_mm),
            seen=replace(prepared.seen, effects=np.concatenate([prepared.seen.effects, moved], axis=-1)),
        )
        model = model_of(session, np.append(best.z, 0.0))
        step, at = solve(*model), 12 + len(best.z)
        if step.b[at] < MIN_SIGMAS * np.sqrt(step.covariance[at, at]):
            continue
        fixed, moving = (
            fixed or marginalise(*model_of(prepared, best.z), prepared.belief),
            marginalise(*model, prepared.belief),
        )
        odds = np.log(kind.probability / (1 - kind.probability)) + moving.log_evidence - fixed.log_evidence
        probability = float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))
        shift = moving.b[:12] - fixed.b[:12]
        wider = moving.covariance[:12, :12] - fixed.covariance[:12, :12] + np.outer(shift, shift)
        found.append(Effect(session, probability, probability * wider))
    return sorted(found, key=lambda effect: -effect.probability)
