"""Probing and sphere-spacing errors of the scanner from a scan of spheres or ball bars; each view is one position."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from calibration.documents.validation import Document
from daemon.model.requests import ArtefactRequest
from registration.io.reading import open_cloud
from registration.points.rigid_motion import scale_to_mm
from registration.points.scanner_acceptance import BASED_ON, PositionDocument, evaluate_acceptance
from registration.points.surface import sample_points

MAX_POINTS = 200_000
"""Points sampled per position: more do not change a 95 % width."""


class AcceptanceDocument(Document):
    """Probing error (form: width of 95 %; size: of the diameter) and sphere-spacing error: the largest of all views."""

    heading = "scanner"

    schema_version: Literal[1] = 1
    """Version of the format."""
    based_on: str
    """The standards that the figures follow."""
    scan_id: str
    """The scan that was evaluated."""
    artefact: ArtefactRequest
    """The sphere or the ball bar."""
    probing_form_mm: float
    """Probing error, form: width of 95 % of the points about their sphere, the largest of all, mm."""
    probing_size_mm: float
    """Probing error, size: of the diameter, mm."""
    sphere_spacing_mm: float | None
    """Sphere-spacing error, mm; null without a ball bar."""
    positions: list[PositionDocument]
    """One entry for each view."""


def assess_clouds(scan_id: str, views: Sequence[tuple[Path, str]], artefact: ArtefactRequest) -> AcceptanceDocument:
    """Evaluate clouds, each with its unit. Raises SphereError, CloudError."""
    clouds = []
    for file, unit in views:
        with open_cloud(file) as source:
            clouds.append(sample_points(source.blocks(), source.layout, scale_to_mm(unit), MAX_POINTS))
    found = evaluate_acceptance(clouds, artefact.radius_mm, artefact.spacing_mm)
    return AcceptanceDocument(
        based_on=BASED_ON,
        scan_id=scan_id,
        artefact=artefact,
        probing_form_mm=found.form_mm,
        probing_size_mm=found.size_mm,
        sphere_spacing_mm=found.spacing_mm,
        positions=list(found.positions),
    )
