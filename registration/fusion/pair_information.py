"""Information (6×6) and gradient of one overlapping pair about the motion between its views.

Twists are [rotation rad × radius, translation] in mm, in base, about a centre: both halves are lengths. Directions in
which the two surfaces slide on each other (plane, cylinder, sphere) carry only noise and are removed
(Zhang, Kaess, Singh: On degeneracy of optimization-based state estimation problems, ICRA 2016).
"""

from dataclasses import dataclass

import numpy as np

from calibration.transforms import Array, skew
from registration.fusion.overlap import Correspondences
from registration.points.surface import CORRELATED_POINTS

FREE_SHARE = 0.004
"""Mean square of normal motion per unit motion below which a direction is free: normals err by up to 3 degrees."""


@dataclass(frozen=True, eq=False)
class PairEvidence:
    """For a twist u of the source against the target: minimise u' `information` u / 2 + `gradient`' u.

    `free` (k, 6): unit twists about `centre` that the surfaces leave undetermined; `sigma_mm`: robust size of the gaps.
    """

    information: Array
    gradient: Array
    free: Array
    sigma_mm: float
    used: int


def evidence(pair: Correspondences, origin: Array, radius_mm: float) -> PairEvidence:
    """Robustly weighted (Tukey's biweight) information without free directions; twists about `origin`."""
    centre = pair.points.mean(axis=0)
    arms = pair.points - centre
    rows = np.hstack([np.cross(arms, pair.normals) / radius_mm, pair.normals])
    sigma_mm = max(1.4826 * float(np.median(np.abs(pair.gaps))), 0.01)
    weights = np.clip(1 - (pair.gaps / (4.685 * sigma_mm)) ** 2, 0, None) ** 2 / (sigma_mm**2 * CORRELATED_POINTS)
    information = (rows * weights[:, None]).T @ rows
    gradient = rows.T @ (weights * pair.gaps)
    values, vectors = np.linalg.eigh(information)
    free = values < FREE_SHARE * weights.sum()
    kept = vectors[:, ~free]
    information, gradient = kept @ (values[~free, None] * kept.T), kept @ (kept.T @ gradient)
    shift = np.eye(6)
    shift[3:, :3] = -skew(centre - origin) / radius_mm
    return PairEvidence(
        shift.T @ information @ shift, shift.T @ gradient, vectors[:, free].T, sigma_mm, int(np.count_nonzero(weights))
    )
