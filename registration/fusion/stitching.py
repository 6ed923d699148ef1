"""Stitching: by how much two views of one surface or edge lie apart in the base."""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array
from registration.errors import ScanError
from registration.fusion.overlap import correspond, reach_of
from registration.points.surface import CORRELATED_POINTS, Surface

MIN_NORMAL_SHARE = 0.02
"""Directions with a smaller share of the squared normals are not shown: the surfaces slide along them."""


@dataclass(frozen=True, eq=False)
class StitchingGap:
    """Where the second view's surface lies less the first's, over the `pairs` of points that both saw.

    gap_mm : median distance along the first surface's normals, positive towards its scanner.
    width_mm : of the middle 95 % of the distances: noise, and what no shift explains.
    base_offset_mm : (3,) the shift that explains the distances best, along the `directions` (k, 3) that normals show:
        one for a plane, two for an edge, three for a corner; 0 along others.
    sigma_mm : (k,) standard deviation of the shift along these directions by the scanner's noise alone.
    overlap : share of the second view's points that the first has seen.
    """

    pairs: int
    gap_mm: float
    width_mm: float
    base_offset_mm: Array
    directions: Array
    sigma_mm: Array
    overlap: float


def measure_gap(
    first: Surface, base_T_first: Array, second: Surface, base_T_second: Array, reach_mm: float | None = None
) -> StitchingGap:
    """The gap between two views (surfaces in their scanners' frames, poses (4, 4)); `reach_mm`: largest distance looked
    for, by default 4 mm or four spacings.

    Raises ScanError when fewer than 100 points of the views are counterparts.
    """
    reach = reach_of([first, second]) if reach_mm is None else reach_mm
    pairs = correspond(second, base_T_second, first, base_T_first, reach)
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
    return StitchingGap(
        len(pairs.gaps), float(np.median(pairs.gaps)), float(high - low), axes[:, shown] @ shift, axes[:, shown].T,
        scatter * np.sqrt(CORRELATED_POINTS / (len(pairs.gaps) * shares[shown])), pairs.fraction,
    )  # fmt: skip
