"""Stitching: by how much two views of one surface or edge lie apart in the base."""

import numpy as np

from calibration.documents.validation import Document
from calibration.transforms import Array
from registration.errors import ScanError
from registration.fusion.overlap import correspond, reach_of
from registration.points.surface import CORRELATED_POINTS, Surface

MIN_NORMAL_SHARE = 0.02
"""Directions with a smaller share of the squared normals are not shown: the surfaces slide along them."""


class StitchedPairDocument(Document):
    """Two views of one surface: by how much the second lies off the first, in the base."""

    views: tuple[int, int]
    """Numbers of the two views, from 0."""
    gap_mm: float
    """Median distance along the first's normals, positive towards its scanner, mm."""
    width_mm: float
    """Width of the middle 95 % of the distances, mm."""
    base_offset_mm: tuple[float, float, float]
    """The shift that explains the distances best, along the base's axes, mm."""
    offset_mm: float
    """Its length, mm."""
    directions: tuple[tuple[float, float, float], ...]
    """Directions in the base that the normals show: one of a plane, two of an edge, three of a corner."""
    sigma_mm: tuple[float, ...]
    """Of the shift along each direction, by the scanner's noise, mm."""
    pairs: int
    """Number of pairs of points."""
    overlap: float
    """Share of the second's points that have a partner, 0 to 1."""


Placed = tuple[Surface, Array]
"""A view's surface in the scanner's frame, and base_T_scanner (4, 4)."""


def measure_gap(
    numbers: tuple[int, int], first: Placed, second: Placed, reach_mm: float | None = None
) -> StitchedPairDocument:
    """Where the second view's surface lies less the first's, over the points that both saw, rounded to 1 nm.

    `numbers`: of the two views; `reach_mm`: largest distance looked for, by default 4 mm or four spacings. Raises
    ScanError when fewer than 100 points of the views are counterparts.
    """
    reach = reach_of([first[0], second[0]]) if reach_mm is None else reach_mm
    pairs = correspond(*second, *first, reach)
    if not pairs.enough:
        what = f"{len(pairs.gaps)} points of the views are counterparts within {reach:g} mm"
        raise ScanError(what, "choose views that overlap, or look further with reach_mm")
    shares, axes = np.linalg.eigh(pairs.normals.T @ pairs.normals / len(pairs.gaps))
    shown = shares >= MIN_NORMAL_SHARE
    along = pairs.normals @ axes[:, shown]
    shift, *_ = np.linalg.lstsq(along, pairs.gaps, rcond=None)
    rest = pairs.gaps - along @ shift
    scatter = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    low, high = np.quantile(pairs.gaps, [0.025, 0.975])
    base_offset_mm = axes[:, shown] @ shift
    sigma_mm = scatter * np.sqrt(CORRELATED_POINTS / (len(pairs.gaps) * shares[shown]))
    return StitchedPairDocument.model_validate(
        {
            "views": numbers,
            "gap_mm": round(float(np.median(pairs.gaps)), 6),
            "width_mm": round(float(high - low), 6),
            "base_offset_mm": base_offset_mm.round(6).tolist(),
            "offset_mm": round(float(np.linalg.norm(base_offset_mm)), 6),
            "directions": axes[:, shown].T.round(6).tolist(),
            "sigma_mm": sigma_mm.round(6).tolist(),
            "pairs": len(pairs.gaps),
            "overlap": round(pairs.fraction, 4),
        }
    )
