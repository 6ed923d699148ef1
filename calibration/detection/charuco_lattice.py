"""Identification of a lattice of corners on a ChArUco board, by correlation with all markers between them at once.

Reading a marker alone needs its outline and every bit, which fails at about a dozen pixels a marker, under noise or at
a grazing angle. Between known corners the place of every bit is known, and only the sum over all markers has to agree.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import cv2
import numpy as np

from calibration.detection.image import Grey
from calibration.detection.lattice import Lattice
from calibration.detection.plane_view import PlaneView
from calibration.problem import Detection
from calibration.targets import Charuco
from calibration.transforms import Array

QUARTER_TURNS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])
MIN_MARKERS = 3
MAX_OFFSET_OF_DIAGONAL = 0.25
"""A corner further from the lattice's plane, in half a square's diagonal, belongs to a marker, not to the board."""
MIN_CORRELATION, MIN_LEAD = 0.5, 0.25
"""Mean correlation of the markers' bits with the image (0 at a wrong place), and its lead over the next best place."""


@dataclass(frozen=True, eq=False)
class MarkerBits:
    """The markers' bits: `centres` (m, b, 2) in squares from the first inner corner; `values` (m, b), for each marker
    with mean 0 and norm 1."""

    centres: Array
    values: Array

    @classmethod
    def of(cls, board: Any, square_mm: float) -> "MarkerBits":
        """The bits of OpenCV's `board`, without the markers' borders."""
        dictionary, size = board.getDictionary(), board.getDictionary().markerSize
        values = [
            cv2.aruco.generateImageMarker(dictionary, int(marker), size + 2, borderBits=1)[1:-1, 1:-1]
            for marker in np.ravel(board.getIds())
        ]
        corners = np.array([corner[:, :2] for corner in board.getObjPoints()], float) / square_mm - 1.0
        step = (np.arange(size) + 1.5) / (size + 2)
        right, down = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
        places = (
            corners[:, 0, None, None] + step[:, None] * right[:, None, None] + step[:, None, None] * down[:, None, None]
        )
        return cls(
            places.reshape(len(corners), -1, 2), _normalise_rows(np.array(values, float).reshape(len(corners), -1))
        )


def assign_ids(image: Grey, target: Charuco, bits: MarkerBits, lattice: Lattice, view: PlaneView) -> Detection | None:
    """The lattice's corners with the board's ids, without outliers; None when the markers do not identify them.

    `view` maps the lattice's cells to pixels.
    """
    smooth = np.asarray(cv2.GaussianBlur(image, (3, 3), 0), np.uint8)
    places = list(_alignments(lattice, target))
    agreement = [
        _mean_correlation(smooth, bits, (bits.centres - shift) @ turn, lattice, view) for turn, shift in places
    ]
    order = np.argsort(agreement)[::-1]
    best, next_best = [*(agreement[k] for k in order[:2]), 0.0, 0.0][:2]
    if best < MIN_CORRELATION or best - next_best < MIN_LEAD:
        return None
    turn, shift = places[order[0]]
    expected, beside = view.map(lattice.cells.astype(float)), view.map(lattice.cells + np.array([0.5, 0.5]))
    kept = np.hypot(*(lattice.points - expected).T) < MAX_OFFSET_OF_DIAGONAL * np.hypot(*(beside - expected).T)
    column, row = (lattice.cells[kept] @ turn.T + shift).T
    return Detection(row * (target.columns - 1) + column, lattice.points[kept])


def _alignments(lattice: Lattice, target: Charuco) -> Iterator[tuple[Array, Array]]:
    """Every rotation (2, 2) and shift (2,) that puts the lattice's cells onto the board's corners."""
    for turn in QUARTER_TURNS:
        turned = lattice.cells @ turn.T
        low, high = turned.min(axis=0), turned.max(axis=0)
        room = np.array([target.columns - 2, target.rows - 2]) - (high - low)
        for shift in product(range(room[0] + 1), range(room[1] + 1)):
            yield turn, np.array(shift) - low


def _mean_correlation(image: Grey, bits: MarkerBits, cells: Array, lattice: Lattice, view: PlaneView) -> float:
    """Mean correlation, -1 to 1, of the image with the markers on the lattice and one square around it.

    `cells` (m, b, 2): the markers' bits in the lattice's cells. 0 where fewer than MIN_MARKERS are in the image.
    """
    near = np.all((cells > -1) & (cells < lattice.cells.max(axis=0) + 1), axis=(1, 2))
    pixels = view.map(cells[near].reshape(-1, 2)).reshape(-1, *cells.shape[1:])
    inside = np.all((pixels >= 0) & (pixels <= np.array(image.shape[::-1]) - 1), axis=(1, 2))
    if inside.sum() < MIN_MARKERS:
        return 0.0
    seen = cv2.remap(image, pixels[inside].astype(np.float32), None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
    return float((_normalise_rows(np.asarray(seen, float)) * bits.values[near][inside]).sum(axis=1).mean())


def _normalise_rows(rows: Array) -> Array:
    """Rows with mean 0 and norm 1; a row without contrast becomes 0."""
    centred = rows - rows.mean(axis=1, keepdims=True)
    return np.asarray(centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1.0))
