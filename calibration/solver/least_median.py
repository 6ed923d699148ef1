"""The largest consistent part of a session, by least median of squares over triples of views.

P. Rousseeuw, "Least median of squares regression", JASA 79, 1984. Three views give X and the target's pose; the score
of a triple is the median over all views of the distance between the target's points seen and predicted.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibration.closed_forms.kronecker import as_rotation, kronecker
from calibration.closed_forms.one_axis import one_axis
from calibration.transforms import Array

MIN_VIEWS = 4
"""Three views are one triple, without other views to check it."""

MAX_TRIPLES = 50
CANDIDATE_TRIPLES = 600
"""Triples drawn at random, of which the MAX_TRIPLES with the best spread of axes are evaluated."""

OUTLIER_SIGMA = 4.0
"""Threshold in robust standard deviations; wide, because a triple's own error adds to the views'."""

SEED = 1


def agreeing_views(
    anchor_T_mount: Array, camera_T_target: Array, points_mm: Array, only_axis: Array | None = None
) -> NDArray[np.bool_]:
    """Mask (n,) of the views that agree with the best triple, refined with all that agree.

    Poses (n, 4, 4); `points_mm` (k, 3) on the target, whose extreme points measure the distances. `only_axis` (3,): of
    all turns, in the mount; X's coordinate along it moves the target with the camera and changes no distance.
    """
    n = len(anchor_T_mount)
    if n < MIN_VIEWS:
        return np.ones(n, bool)
    corners = points_mm[[0, -1]] if len(points_mm) < 4 else points_mm[_extremes(points_mm)]

    def solve(groups: NDArray[np.intp]) -> Array:
        if only_axis is None:
            return kronecker(anchor_T_mount[groups], camera_T_target[groups])
        return np.array([one_axis(anchor_T_mount[rows], camera_T_target[rows], only_axis) for rows in groups])

    triples = _spread_triples(anchor_T_mount[:, :3, :3])
    distances = _distances(anchor_T_mount, camera_T_target, triples, solve(triples), corners)
    majority = n // 2 + 1
    ranked = np.sort(distances, axis=1)[:, majority - 1]
    best = int(np.argmin(ranked))
    agreeing = _within(distances[best], n)
    for _ in range(3):
        rows = np.flatnonzero(agreeing)[None]
        agreeing = _within(_distances(anchor_T_mount, camera_T_target, rows, solve(rows), corners)[0], n)
    return agreeing


def _within(distances: Array, n: int) -> NDArray[np.bool_]:
    majority = n // 2 + 1
    middle = float(np.sort(distances)[majority - 1])
    # Rousseeuw's finite-sample factor; a distance of six summed squares has its median near its deviation.
    scale = middle * (1 + 5 / max(n - 3, 1))
    return distances <= OUTLIER_SIGMA * max(scale, 1e-6)


def _extremes(points_mm: Array) -> list[int]:
    sums, differences = points_mm[:, 0] + points_mm[:, 1], points_mm[:, 0] - points_mm[:, 1]
    return [int(np.argmin(sums)), int(np.argmax(differences)), int(np.argmax(sums)), int(np.argmin(differences))]


def _spread_triples(rotations: Array) -> NDArray[np.intp]:
    """Triples of views (t, 3) with the best spread of rotation axes."""
    n = len(rotations)
    if n <= 12:
        triples = np.array(list(combinations(range(n), 3)))
    else:
        rng = np.random.default_rng(SEED)
        triples = np.argpartition(rng.random((CANDIDATE_TRIPLES, n)), 2, axis=1)[:, :3]
    # The smallest singular value of the stacked (R_A - I) measures how well the translation is determined.
    turned = rotations[triples] - rotations[triples].mean(axis=1, keepdims=True)
    stacked = turned.reshape(len(triples), 9, 3)
    spread = np.linalg.eigvalsh(np.swapaxes(stacked, 1, 2) @ stacked)[:, 0]
    return triples[np.argsort(-spread)[:MAX_TRIPLES]]


def _distances(
    anchor_T_mount: Array, camera_T_target: Array, groups: NDArray[np.intp], mount_T_camera: Array, corners: Array
) -> Array:
    """RMS distance (g, n) mm in the anchor between the target's corners by each view and by each group's X."""
    n, g = len(anchor_T_mount), len(groups)
    # The upper three rows of anchor_T_target (n, g, 3, 4), all views and groups in two products.
    rows = anchor_T_mount[:, :3].reshape(3 * n, 4) @ mount_T_camera.transpose(1, 0, 2).reshape(4, 4 * g)
    rows = rows.reshape(n, 3, g, 4).transpose(0, 2, 1, 3).reshape(n, 3 * g, 4)
    seen = (rows @ camera_T_target).reshape(n, g, 3, 4)
    mean = seen[groups, np.arange(g)[:, None]].mean(axis=1)
    target = np.concatenate([as_rotation(mean[:, :, :3]), mean[:, :, 3:]], axis=2)
    homogeneous = np.column_stack([corners, np.ones(len(corners))])
    apart = (seen - target).reshape(-1, 4) @ homogeneous.T
    squares = (apart * apart).reshape(n, g, -1).sum(axis=2)
    distances: Array = np.sqrt(squares.T / len(corners))
    return distances
