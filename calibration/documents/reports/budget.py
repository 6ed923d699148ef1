"""What the uncertainty of the worst of the points that matter is made of, in mm and as shares of its variance."""

import math

import numpy as np

from calibration.documents.calibration import CalibrationDocument, PointUncertaintyDocument
from calibration.documents.reports.blocks import table
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.numbers import DASH, number, significant
from calibration.likelihood.mapped_points import point_rows, scale_variance_mm2
from calibration.solution import worst_of
from calibration.transforms import Array

TURN, SHIFT = slice(0, 3), slice(3, 6)


def budget_at_worst(document: CalibrationDocument) -> Markup | None:
    """The parts of u at the worst point; None in a document without a covariance."""
    sure = document.uncertainty
    covariance = None if sure is None else sure.matrix()
    if sure is None or covariance is None or not sure.points:
        return None
    worst, scale = worst_of(sure.points), sure.arm_scale
    by_scale = None if scale is None else scale_variance_mm2(scale.scale(), np.array(worst.camera_mm))
    rows = [*point_variances(covariance, worst), ("scale between scanner and arm (B)", by_scale)]
    total = sum(variance for _, variance in rows if variance is not None)
    shown = [(name, _root(variance), _share(variance, total)) for name, variance in rows]
    shown.append(("combined", significant(math.sqrt(max(total, 0.0))), "100 %"))
    registered = significant(sure.registered_expanded_mm(worst))
    about = (
        f"At {worst.name}, the worst of the points that matter; shares are of the variance. A negative one: turn and"
        " shift of the camera err against each other there. Lens and target are in both. U above is in the arm's"
        f" millimetres; of a registered point, in the scanner's, it is {registered} mm."
    )
    return join(table(("part", "u / mm", "share"), shown), tag("p", about, class_="small"))


def point_variances(covariance: Array, point: PointUncertaintyDocument) -> list[tuple[str, float]]:
    """Variances in mm², over all three axes, of the point by the parts of `covariance` (6, 6) of X @ exp(v)."""
    rows = point_rows(np.array([point.camera_mm]))[0]

    def variance(kept: Array) -> float:
        return float(np.trace(rows @ kept @ rows.T))

    turn, shift = np.zeros((6, 6)), np.zeros((6, 6))
    turn[TURN, TURN], shift[SHIFT, SHIFT] = covariance[TURN, TURN], covariance[SHIFT, SHIFT]
    return [
        ("turn of the camera (A)", variance(turn)),
        ("shift of the camera (A)", variance(shift)),
        ("both together (A)", variance(covariance - turn - shift)),
    ]


def _root(variance: float | None) -> str:
    return DASH if variance is None else significant(math.copysign(math.sqrt(abs(variance)), variance))


def _share(variance: float | None, total: float) -> str:
    return DASH if variance is None or total <= 0 else f"{number(100 * variance / total, 0)} %"
