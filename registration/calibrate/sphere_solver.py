"""X from a sphere that is scanned from many directions.

In every view anchor_T_mount @ X @ c = s, where c is the centre in the camera's cloud and s the same point of the anchor
each time: of the base with the camera on the flange, of the flange with a standing camera. Unknowns are X (6 numbers)
and s (3); each view gives 3 equations. A sphere has no orientation, so X's rotation is determined only by centres at
different places of the camera's field of view.
"""

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from calibration.errors import UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, rotation_angle_rad, rotation_from_vector, skew, transform

MIN_VIEWS = 4
MAX_ITERATIONS = 60
MIN_NOISE_MM = 0.05
ROTATION_LIMIT_RAD = float(np.deg2rad(2.0))
TRANSLATION_LIMIT_MM = 15.0
OUTLIER_RATIO = 3.0
"""A view is rejected when the others agree this many times better without it; robot errors are far more even."""
OUTLIER_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class SphereSolution:
    """X and the centre in the anchor, with their uncertainty.

    `covariance` (6, 6) of [rotation rad, translation mm] of mount_T_camera @ exp(.), in the camera frame. `spread_mm`
    (3,): standard deviation of the centre over the views, per axis of the anchor. `left_out_mm` (n,): distance of each
    view's centre from where the others put it, with X solved without that view; None below five views. `used`: the
    views that agree, to which all figures refer.
    """

    mount_T_camera: Array
    anchor_centre_mm: Array
    covariance: Array
    sigma_mm: float
    spread_mm: Array
    left_out_mm: Array | None
    used: tuple[int, ...]


def solve_from_sphere(centres_mm: Array, anchor_T_mount: Array) -> SphereSolution:
    """Maximum likelihood with robust weights, of n views: the sphere's centre in the camera's frame (n, 3) mm, and the
    mount's pose (n, 4, 4). Raises UndeterminedError when the views do not determine X."""
    views = len(centres_mm)
    if views < MIN_VIEWS:
        raise UndeterminedError(
            "too-few-views", Sentence("sphere-views", views=views), Sentence("scan-from", least=MIN_VIEWS)
        )
    system = _SphereSystem(anchor_T_mount[:, :3, :3], anchor_T_mount[:, :3, 3], centres_mm)
    kept = list(range(views))
    estimate = _solve(system)
    while (views - len(kept)) < OUTLIER_SHARE * views and (bad := _outlier(system, estimate)) is not None:
        del kept[bad]
        system = system.without(bad)
        estimate = _descend(system, estimate)
    covariance = _covariance(system, estimate)
    residuals = system.residuals(estimate)
    left_out: list[float] | None = None
    if len(kept) > MIN_VIEWS:
        without = [_descend(system.without(index), estimate) for index in range(len(kept))]
        left_out = [float(np.linalg.norm(system.residuals(one)[index])) for index, one in enumerate(without)]
    return SphereSolution(
        transform(estimate.rotation, estimate.translation),
        estimate.centre,
        covariance,
        _sigma(system, estimate),
        residuals.std(axis=0),
        None if left_out is None else np.array(left_out),
        tuple(kept),
    )


@dataclass(frozen=True, eq=False)
class _Estimate:
    rotation: Array
    translation: Array
    centre: Array


@dataclass(frozen=True, eq=False)
class _SphereSystem:
    """The views stacked: base rotations (n, 3, 3), base translations (n, 3), centres (n, 3)."""

    rotations: Array
    translations: Array
    centres: Array

    def without(self, index: int) -> "_SphereSystem":
        return _SphereSystem(
            *(np.delete(stack, index, axis=0) for stack in (self.rotations, self.translations, self.centres))
        )

    def residuals(self, estimate: _Estimate) -> Array:
        """(n, 3): each view's centre in the anchor minus the common one."""
        flange = self.centres @ estimate.rotation.T + estimate.translation
        found: Array = np.einsum("nij,nj->ni", self.rotations, flange) + self.translations - estimate.centre
        return found

    def jacobian(self, estimate: _Estimate) -> Array:
        """(n, 3, 9) by [rotation in the camera frame rad, translation in the flange frame mm, centre mm]."""
        count = len(self.centres)
        turned = self.rotations @ (estimate.rotation @ -skew(self.centres))
        return np.concatenate([turned, self.rotations, np.broadcast_to(-np.eye(3), (count, 3, 3))], axis=2)


def _solve(system: _SphereSystem) -> _Estimate:
    """Best minimum from 24 starts; raises UndeterminedError when another fits as well."""
    estimates = [_descend(system, _linear(system, rotation)) for rotation in cube_rotations()]
    found = [(_sigma(system, estimate), estimate) for estimate in estimates]
    found.sort(key=lambda entry: entry[0])
    best, estimate = found[0]
    for sigma_mm, other in found[1:]:
        apart = float(rotation_angle_rad(other.rotation.T @ estimate.rotation))
        if apart > 10 * ROTATION_LIMIT_RAD and sigma_mm < 1.5 * best + MIN_NOISE_MM:
            what = Sentence("sphere-ambiguous", off_deg=float(np.rad2deg(apart)))
            raise UndeterminedError("ambiguous", what, FIX)
    return estimate


def _linear(system: _SphereSystem, rotation: Array) -> _Estimate:
    """Translation and centre that best fit a given rotation."""
    count = len(system.centres)
    matrix = np.concatenate([system.rotations, np.broadcast_to(-np.eye(3), (count, 3, 3))], axis=2).reshape(-1, 6)
    right = -(np.einsum("nij,nj->ni", system.rotations, system.centres @ rotation.T) + system.translations)
    solution = np.linalg.lstsq(matrix, right.ravel(), rcond=None)[0]
    return _Estimate(rotation, solution[:3], solution[3:])


def _descend(system: _SphereSystem, start: _Estimate) -> _Estimate:
    """Levenberg-Marquardt."""
    estimate, damping = start, 1e-3
    residuals = system.residuals(estimate)
    for _ in range(MAX_ITERATIONS):
        rows = system.jacobian(estimate).reshape(-1, 9)
        information = rows.T @ rows
        scale = np.diag(np.maximum(np.diag(information), 1e-9))
        step = -np.linalg.solve(information + damping * scale, rows.T @ residuals.ravel())
        trial = _Estimate(
            estimate.rotation @ rotation_from_vector(step[:3]),
            estimate.translation + step[3:6],
            estimate.centre + step[6:],
        )
        after = system.residuals(trial)
        if np.sum(after**2) <= np.sum(residuals**2):
            estimate, residuals, damping = trial, after, damping / 10
        else:
            damping *= 10
        if np.abs(step[3:]).max() < 1e-7 or damping > 1e9:
            break
    return estimate


def _outlier(system: _SphereSystem, estimate: _Estimate) -> int | None:
    """The view without which the others agree far better; None when there is none."""
    count = len(system.centres)
    if count <= MIN_VIEWS + 1:
        return None
    sizes = [_sigma(rest := system.without(index), _descend(rest, estimate)) for index in range(count)]
    worst = int(np.argmin(sizes))
    alone = max(sizes[worst], MIN_NOISE_MM) < _sigma(system, estimate) / OUTLIER_RATIO
    return worst if alone else None


def _sigma(system: _SphereSystem, estimate: _Estimate) -> float:
    """Standard deviation of a coordinate of the centre, with 9 fitted parameters."""
    freedom = max(3 * len(system.centres) - 9, 1)
    return float(np.sqrt(np.sum(system.residuals(estimate) ** 2) / freedom))


def _covariance(system: _SphereSystem, estimate: _Estimate) -> Array:
    """(6, 6) in the camera frame. Raises UndeterminedError."""
    rows = system.jacobian(estimate).reshape(-1, 9)
    values, vectors = np.linalg.eigh(rows.T @ rows)
    if values[0] <= 1e-12 * values[-1]:
        raise UndeterminedError("sphere-unobservable", _weakest(vectors[:, 0]), FIX)
    covariance = (vectors / values @ vectors.T)[:6, :6] * max(_sigma(system, estimate), MIN_NOISE_MM) ** 2
    deviations = np.sqrt(np.diag(covariance))
    if deviations[:3].max() > ROTATION_LIMIT_RAD or deviations[3:].max() > TRANSLATION_LIMIT_MM:
        raise UndeterminedError("sphere-unobservable", _weakest(vectors[:, 0]), FIX)
    to_camera = np.eye(6)
    to_camera[3:, 3:] = estimate.rotation.T
    in_camera: Array = to_camera @ covariance @ to_camera.T
    return in_camera


FIX = Sentence("turn-and-spread-sphere")


def _weakest(direction: Array) -> Sentence:
    turns = np.linalg.norm(direction[:3]) * 300 > np.linalg.norm(direction[3:6])
    return Sentence("sphere-leaves-rotation" if turns else "sphere-leaves-translation")


def cube_rotations() -> list[Array]:
    """The 24 rotations of a cube: no rotation is further than 63 degrees from the nearest."""
    matrices = [
        np.eye(3)[list(order)] * np.array(signs, float)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]
    return [matrix for matrix in matrices if np.linalg.det(matrix) > 0]
