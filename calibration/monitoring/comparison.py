"""Comparison of two calibrations of one camera: how far apart they are, beside what both claim to know."""

from typing import Literal

import numpy as np
import scipy
from pydantic import JsonValue

from calibration.documents.calibration import (
    COVARIANCE_ORDER,
    TRANSFORM_NAMES,
    CalibrationDocument,
    PlaceDocument,
    PointUncertaintyDocument,
    ReasonDocument,
    Six,
)
from calibration.documents.pose import Vector
from calibration.documents.validation import Document
from calibration.errors import ComparisonError
from calibration.likelihood.mapped_points import point_sigmas_mm
from calibration.problem import Setup
from calibration.sentences.sentence import Sentence
from calibration.solution import COVERAGE_FACTOR
from calibration.transforms import Array, inverse, map_points, vector_from_transform

FALSE_ALARM_PROBABILITY = 0.01
"""Default probability that two calibrations that agree are said to contradict each other."""

UNKNOWNS = 6


class ComparedPointDocument(PlaceDocument):
    """One of the points that matter, mapped through both."""

    difference_mm: float
    """Distance of the point as mapped by the two, mm."""
    expanded_mm: float | None
    """U (k = 2) of that distance, mm; null without a covariance."""


class ComparisonDocument(Document):
    """`b` compared with `a`: d, with X_b = X_a exp(d); its covariance is the sum of both claimed ones."""

    heading = "comparison"

    a: str
    """Id of the first calibration."""
    b: str
    """Id of the second, which is compared with it."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    translation_mm: float
    """Length of the translation between the two X, mm."""
    rotation_deg: float
    """Angle of the rotation between the two X, degrees."""
    translation_along_mm: Vector
    """The translation along the axes of the first's camera, mm."""
    rotation_about_deg: Vector
    """The rotation about these axes, a rotation vector in degrees."""
    points: tuple[ComparedPointDocument, ...]
    """How far the points that matter move."""
    covariance: tuple[Six, Six, Six, Six, Six, Six] | None
    """6 x 6 of the difference, rad and mm; null where one has none."""
    covariance_frame: Literal["camera"] = "camera"
    """Axes of the covariance: camera."""
    covariance_order: tuple[str, str, str, str, str, str] = COVARIANCE_ORDER
    """Names of its rows and columns."""
    coverage_factor: float = COVERAGE_FACTOR
    """k: U is k times the standard deviation."""
    mahalanobis: float | None
    """Length of the difference in terms of its covariance; null without. No unit."""
    probability: float | None
    """That errors as claimed put two calibrations of one camera further apart."""
    false_alarm_probability: float
    """Probability below which the two are said to disagree, 0 to 1."""
    agree: bool | None
    """Whether the probability is at least that; null without a covariance."""
    summary: ReasonDocument
    """The result in a sentence."""


def compare(
    a: CalibrationDocument, b: CalibrationDocument, false_alarm_probability: float = FALSE_ALARM_PROBABILITY
) -> ComparisonDocument:
    """The difference of two calibrations with X, of one set-up. Raises ComparisonError.

    At the points that matter of `a`, or of `b` when `a` has none. The errors of the two count as independent.
    """
    x_a, x_b = _mount_T_camera(a), _mount_T_camera(b)
    if a.setup != b.setup:
        raise ComparisonError(
            f"calibration {a.id} is {a.setup} and {b.id} is {b.setup}", "compare two of the same set-up"
        )
    step = vector_from_transform(inverse(x_a) @ x_b)
    covariance = _covariance(a, b)
    points = tuple(_point(point, x_a, x_b, covariance) for point in _points(a) or _points(b))
    mahalanobis = None if covariance is None else _length(step, covariance)
    probability = None if mahalanobis is None else float(scipy.special.chdtrc(UNKNOWNS, mahalanobis**2))
    agree = None if probability is None else probability >= false_alarm_probability
    translation_mm, rotation_deg = float(np.linalg.norm(step[3:])), float(np.degrees(np.linalg.norm(step[:3])))
    return ComparisonDocument.model_validate(
        {
            "a": a.id,
            "b": b.id,
            "setup": a.setup,
            "translation_mm": translation_mm,
            "rotation_deg": rotation_deg,
            "translation_along_mm": step[3:].tolist(),
            "rotation_about_deg": np.degrees(step[:3]).tolist(),
            "points": points,
            "covariance": None if covariance is None else covariance.tolist(),
            "mahalanobis": mahalanobis,
            "probability": probability,
            "false_alarm_probability": false_alarm_probability,
            "agree": agree,
            "summary": ReasonDocument.of(
                _summary(translation_mm, rotation_deg, points, mahalanobis, probability, agree)
            ),
        }
    )


def _mount_T_camera(document: CalibrationDocument) -> Array:
    pose = getattr(document, TRANSFORM_NAMES[document.setup][0])
    if pose is None:
        raise ComparisonError(f"calibration {document.id} holds no transform", "compare two that do")
    mount_T_camera: Array = pose.transform()
    return mount_T_camera


def _points(document: CalibrationDocument) -> tuple[PointUncertaintyDocument, ...]:
    return () if document.uncertainty is None else document.uncertainty.points


def _covariance(a: CalibrationDocument, b: CalibrationDocument) -> Array | None:
    """Of the difference (6, 6); None when one of them claims none."""
    claimed = [one.uncertainty.matrix() for one in (a, b) if one.uncertainty is not None]
    known = [matrix for matrix in claimed if matrix is not None]
    return np.asarray(known[0] + known[1]) if len(known) == 2 else None


def _length(step: Array, covariance: Array) -> float | None:
    """The Mahalanobis length of `step` (6,), None where the covariance (6, 6) is singular."""
    try:
        return float(np.linalg.norm(np.linalg.solve(np.linalg.cholesky(covariance), step)))
    except np.linalg.LinAlgError:
        return None


def _point(point: PointUncertaintyDocument, x_a: Array, x_b: Array, covariance: Array | None) -> ComparedPointDocument:
    camera_mm = np.array([point.camera_mm])
    apart_mm = float(np.linalg.norm(map_points(x_a, camera_mm) - map_points(x_b, camera_mm)))
    expanded = None if covariance is None else COVERAGE_FACTOR * float(point_sigmas_mm(covariance, camera_mm)[0])
    return ComparedPointDocument(
        name=point.name, frame=point.frame, position_mm=point.position_mm, difference_mm=apart_mm, expanded_mm=expanded
    )


def _summary(
    translation_mm: float,
    rotation_deg: float,
    points: tuple[ComparedPointDocument, ...],
    mahalanobis: float | None,
    probability: float | None,
    agree: bool | None,
) -> Sentence:
    apart = Sentence("compared-apart", translation_mm=translation_mm, rotation_deg=rotation_deg)
    if points:
        worst = max(points, key=lambda point: point.difference_mm)
        params: dict[str, JsonValue] = {"difference_mm": worst.difference_mm, "point": worst.name}
        apart = (
            Sentence("compared-at-points", apart=apart, **params)
            if worst.expanded_mm is None
            else Sentence("compared-at-known-points", apart=apart, **params, expanded_mm=worst.expanded_mm)
        )
    if mahalanobis is None or probability is None:
        return Sentence("compared-unknown", apart=apart)
    verdict = "compared-agree" if agree else "compared-contradict"
    return Sentence(verdict, apart=apart, mahalanobis=mahalanobis, percent=100 * probability)


def comparison_text(found: ComparisonDocument) -> str:
    """A comparison in a few lines, the summary first."""
    along = ", ".join(f"{value:+.3f}" for value in found.translation_along_mm)
    about = ", ".join(f"{value:+.4f}" for value in found.rotation_about_deg)
    lines = [
        f"{found.b} compared with {found.a}: {found.summary.message}",
        f"  translation  {found.translation_mm:.3f} mm, ({along}) along the camera's axes",
        f"  rotation     {found.rotation_deg:.4f} deg, ({about}) about the camera's axes",
    ]
    for point in found.points:
        known = "" if point.expanded_mm is None else f", both know it to U = {point.expanded_mm:.3f} mm (k = 2)"
        lines.append(f"  {point.name:<22} {point.difference_mm:.3f} mm{known}")
    return "\n".join(lines)
