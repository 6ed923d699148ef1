"""Scanner acceptance from spheres and ball bars, based on VDI/VDE 2634-3 and ISO 10360-13.

Probing error (form): width that contains 95 % of the distances from the sphere fitted with free radius. Probing error
(size): fitted minus calibrated diameter. Sphere-spacing error: measured minus calibrated distance of a ball bar's
centres. "Based on", since the standards also prescribe artefacts, positions and temperature.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import ConfigDict

from calibration.sentences.described import Described
from calibration.targets import IN_DOCUMENTS
from calibration.transforms import Array
from registration.errors import SphereError
from registration.points.sphere_fit import find_artefact, fit_sphere

BASED_ON = "based on VDI/VDE 2634-3 and ISO 10360-13"
FORM_SHARE = 0.95
BALL_RADII = 1.25
"""Points within this many radii of a ball's centre belong to it or its holder."""


@dataclass(frozen=True)
class ProbedBall(Described):
    """One ball in one position, in the scanner's frame."""

    __pydantic_config__: ClassVar[ConfigDict] = IN_DOCUMENTS

    centre_mm: tuple[float, float, float]
    """Its centre in the scanner's frame, mm."""
    form_mm: float
    """Width of 95 % of its points about their sphere, mm."""
    size_mm: float
    """Measured less calibrated diameter, mm."""
    points: int
    """Number of points."""


@dataclass(frozen=True)
class PositionDocument(Described):
    """What one view shows."""

    __pydantic_config__: ClassVar[ConfigDict] = IN_DOCUMENTS

    view: int
    """Of the view, from 0."""
    balls: tuple[ProbedBall, ...]
    """The balls in sight."""
    spacing_error_mm: float | None
    """Measured less calibrated distance, mm; null without a ball bar."""


@dataclass(frozen=True, eq=False)
class Acceptance:
    """Largest magnitudes over all positions; `spacing_mm` is None without a ball bar."""

    positions: tuple[PositionDocument, ...]
    form_mm: float
    size_mm: float
    spacing_mm: float | None


def evaluate_acceptance(clouds: Sequence[Array], radius_mm: float, spacing_mm: float | None = None) -> Acceptance:
    """Evaluate one cloud (n, 3) in mm per position. Raises SphereError, naming the position."""
    if not clouds:
        raise SphereError("there are no positions", "scan the artefact in at least one")
    positions: list[PositionDocument] = []
    for view, points in enumerate(clouds):
        try:
            first, centre, rest = _ball(points, radius_mm)
            if spacing_mm is None:
                positions.append(PositionDocument(view, (first,), None))
                continue
            second, other, _ = _ball(rest, radius_mm)
        except SphereError as error:
            raise SphereError(f"position {view}: {error.what}", error.fix) from None
        error_mm = float(np.linalg.norm(other - centre)) - spacing_mm
        positions.append(PositionDocument(view, (first, second), round(error_mm, 5)))
    balls = [ball for position in positions for ball in position.balls]
    spacings = [position.spacing_error_mm for position in positions if position.spacing_error_mm is not None]
    return Acceptance(
        tuple(positions),
        max(ball.form_mm for ball in balls),
        max((ball.size_mm for ball in balls), key=abs),
        max(spacings, key=abs) if spacings else None,
    )


def _ball(points: Array, radius_mm: float) -> tuple[ProbedBall, Array, Array]:
    """A ball of the calibrated radius, its centre (3,), and the points that are not its own. Raises SphereError."""
    points = points[np.isfinite(points).all(axis=1)]
    found = find_artefact(points, radius_mm)
    distance = np.linalg.norm(points - found.centre, axis=1)
    free = fit_sphere(points[np.abs(distance - radius_mm) < 0.1 * radius_mm])
    gaps = np.linalg.norm(points - free.centre, axis=1) - free.radius_mm
    own = gaps[np.abs(gaps) < 0.1 * radius_mm]
    low, high = np.quantile(own, [(1 - FORM_SHARE) / 2, (1 + FORM_SHARE) / 2])
    x, y, z = free.centre.tolist()
    form_mm, size_mm = float(high - low), float(2 * (free.radius_mm - radius_mm))
    probed = ProbedBall((x, y, z), round(form_mm, 5), round(size_mm, 5), len(own))
    return probed, free.centre, points[distance > BALL_RADII * radius_mm]
