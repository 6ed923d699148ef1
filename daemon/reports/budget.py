"""The uncertainty budget of a calibration: its sources, and the parts of u at the worst of the points that matter."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibration.documents.calibration import CalibrationDocument, PointUncertaintyDocument, UncertaintyDocument
from calibration.likelihood.mapped_points import point_rows, scale_variance_mm2
from calibration.transforms import Array

TURN, SHIFT = slice(0, 3), slice(3, 6)


Part = tuple[str, float | None, float | None]
"""A part of u by its word: u in mm with the sign of its variance, and its share in percent; None: not known."""


@dataclass(frozen=True)
class PointBudget:
    """The parts of u at a point and u itself; `registered_mm`: U there in a cloud."""

    point: str
    parts: tuple[Part, ...]
    combined_mm: float
    registered_mm: float


def budget_at_worst(sure: UncertaintyDocument | None) -> PointBudget | None:
    """The parts of u at the worst point; None in a document without a covariance."""
    covariance = None if sure is None else sure.matrix()
    worst = None if sure is None else sure.worst_point
    if sure is None or covariance is None or worst is None:
        return None
    scale = sure.arm_scale
    by_scale = None if scale is None else scale_variance_mm2(scale.scale(), np.array(worst.camera_mm))
    variances = {**point_variances(covariance, worst), "budget.scale-part": by_scale}
    total = sum(variance for variance in variances.values() if variance is not None)
    return PointBudget(
        worst.name,
        tuple(
            (word, None, None)
            if variance is None
            else (
                word,
                math.copysign(math.sqrt(abs(variance)), variance),
                100 * variance / total if total > 0 else None,
            )
            for word, variance in variances.items()
        ),
        math.sqrt(max(total, 0.0)),
        sure.registered_expanded_mm(worst),
    )


def point_variances(covariance: Array, point: PointUncertaintyDocument) -> dict[str, float]:
    """Variances in mm², over all three axes, of the point by the parts of `covariance` (6, 6) of X @ exp(v)."""
    rows = point_rows(np.array([point.camera_mm]))[0]

    def variance(kept: Array) -> float:
        return float(np.trace(rows @ kept @ rows.T))

    turn, shift = np.zeros((6, 6)), np.zeros((6, 6))
    turn[TURN, TURN], shift[SHIFT, SHIFT] = covariance[TURN, TURN], covariance[SHIFT, SHIFT]
    return {
        "budget.turn": variance(turn),
        "budget.shift": variance(shift),
        "budget.both": variance(covariance - turn - shift),
    }


def noise_sources(document: CalibrationDocument) -> Iterator[tuple[str, float | None, str]]:
    """Sources of type A by their word, one standard deviation with its unit."""
    noise = document.noise
    yield "budget.corners", noise.image_px, "px"
    yield "budget.robot-position", noise.robot_translation_mm, "mm"
    yield "budget.robot-orientation", noise.robot_rotation_deg, "\u00b0"


def scale_percent(document: CalibrationDocument) -> float | None:
    """By how much lengths of the arm and of the scanner may differ, percent."""
    scale = document.uncertainty and document.uncertainty.arm_scale
    return 100 * math.hypot(scale.sigma, scale.log) if scale else None
