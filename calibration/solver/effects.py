"""Rare effects: tangential distortion that is not described, autofocus, and glass before the target.

To first order each looks like a size of the target, or another place or direction of the camera, so that pictures alone
seldom show it, and robot and pictures together do. One is taken up where it is likelier than not, and widens the
uncertainty by its probability where it is not.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from calibration.camera import CameraModel
from calibration.likelihood.estimate import exact_pixels, linearise
from calibration.likelihood.mixed_model import MixedModel, Variances, solve
from calibration.likelihood.noise_marginalisation import Marginal, marginalise
from calibration.likelihood.nuisances import TANGENTIAL
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import squared_distances
from calibration.preprocessing.prepare import PreparedSession
from calibration.solver.view_outliers import Selection, select_views
from calibration.transforms import Array, inverse, map_points

PROBABILITY = 0.05
"""Prior probability of each."""

MIN_SHOWING_VIEWS = 12
"""From here on pictures alone show tangential distortion (`find_deviations`); an arm's errors may look like it."""

MIN_SIGMAS = 0.5
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
    """A kind of effect by the `code` and `fix` of its finding, and its size if it is there, above 0."""

    code: str
    fix: str
    sigma_mm: float
    moved: Callable[[CameraModel, Array, Array], Array]
    """By a camera, poses camera_T_target (n, 4, 4) and points (n, m, 3): their displacements, on the target."""


KINDS = (
    Kind("lens-refocuses", "switch-autofocus-off", 20.0, refocusing),
    Kind("target-below-glass", "uncover-target", 5.0, glass),
)


@dataclass(frozen=True, eq=False)
class Alternative:
    """A session with more unknowns, of which z from `place` on are `more`; its `probability`, first the prior one.

    `wider` (12, 12): what it adds to the covariance of X and the target's pose where it is not taken up.
    """

    prepared: PreparedSession
    place: int
    more: int
    probability: float
    wider: Array = field(default_factory=lambda: np.zeros((12, 12)))

    def start(self, z: Array) -> Array:
        """Where its unknowns start from those without them."""
        return np.insert(z, [self.place] * self.more, 0.0)


def take_up_effects(prepared: PreparedSession, selection: Selection) -> tuple[PreparedSession, Selection, Array]:
    """The session and its estimate with the effects that are likelier than not.

    And what the others add to the covariance (12, 12) of X and the target's pose, by their probability.
    """
    while (found := _weigh(prepared, selection)) and found[0].probability > 0.5:
        best, first = selection.best, found[0]
        prepared = replace(first.prepared, z=first.start(prepared.z))
        selection = select_views(prepared, selection.used, best.chain, best.variances, first.start(best.z))
    return prepared, selection, sum((one.wider for one in found), np.zeros((12, 12)))


def _alternatives(prepared: PreparedSession, camera: CameraModel) -> Iterator[Alternative]:
    """Those with one effect more, by their prior probability."""
    nuisances, seen = prepared.nuisances, prepared.seen
    if nuisances.knows_tangential and len(seen) < MIN_SHOWING_VIEWS:
        session = replace(prepared, nuisances=nuisances.with_tangential())
        yield Alternative(session, TANGENTIAL[0], len(TANGENTIAL), PROBABILITY)
    for kind in KINDS:
        if kind.code not in nuisances.effects:
            moved = kind.moved(camera, prepared.camera_T_target, seen.points_mm)[..., None]
            session = replace(
                prepared,
                nuisances=nuisances.with_effect(kind.code, kind.sigma_mm),
                seen=replace(seen, effects=np.concatenate([seen.effects, moved], axis=-1)),
            )
            yield Alternative(session, len(nuisances), 1, PROBABILITY)


def _weigh(prepared: PreparedSession, selection: Selection) -> list[Alternative]:
    """Those of which the selection's views say more than a little, the likeliest first."""
    best, used, found = selection.best, selection.used, list[Alternative]()
    fixed: Marginal | None = None

    def model_of(session: PreparedSession, z: Array) -> tuple[MixedModel, Variances]:
        pixels = exact_pixels(session.seen.take(used), session.nuisances)
        model = linearise(pixels, best.chain, session.nuisances, z)
        return model, estimate_variances(model, best.variances)

    def weighed(one: Alternative) -> Alternative | None:
        nonlocal fixed
        model = model_of(one.prepared, one.start(best.z))
        step, at = solve(*model), 12 + one.place + np.arange(one.more)
        size, covariance = step.b[at], step.covariance[np.ix_(at, at)]
        if squared_distances(size, covariance) < one.more * MIN_SIGMAS**2 or (one.more == 1 and size[0] < 0):
            return None  # glass does not lift what is below it; most lenses lengthen f when they focus nearer
        fixed = fixed or marginalise(*model_of(prepared, best.z), prepared.belief)
        moving = marginalise(*model, prepared.belief)
        odds = np.log(one.probability / (1 - one.probability)) + moving.log_evidence - fixed.log_evidence
        probability = float(1 / (1 + np.exp(-np.clip(odds, -500.0, 500.0))))
        shift = moving.b[:12] - fixed.b[:12]
        wider, along = np.linalg.eigh(moving.covariance[:12, :12] - fixed.covariance[:12, :12] + np.outer(shift, shift))
        return replace(one, probability=probability, wider=probability * (along * np.maximum(wider, 0.0)) @ along.T)

    for one in _alternatives(prepared, best.camera):
        with suppress(np.linalg.LinAlgError, ArithmeticError):  # what cannot be computed is not taken up
            found += [alternative] if (alternative := weighed(one)) else []
    return sorted(found, key=lambda one: -one.probability)
