"""A diagnosis as findings: the cause, the robot noise without and with it, and the fix."""

from collections.abc import Set

import numpy as np

from calibration.diagnosis.diagnose import MIN_LOG_LIKELIHOOD_GAIN, Diagnosis
from calibration.diagnosis.intrinsics_check import LensMisfit
from calibration.diagnosis.view_hypotheses import CHANGE_CODES
from calibration.solution import Finding, Severity

DISAGREE = "Robot and images disagree"
MAX_PRINT_SCALE_ERROR = 0.01
"""Up to a hundredth is a printer; more is a wrong number."""

MAX_LENS_SHARE = 0.005
"""Largest shift of the target over its distance for a warning; more is an error (another camera or focus)."""


def diagnosis_findings(diagnosis: Diagnosis, used: Set[int] = frozenset()) -> tuple[Finding, ...]:
    """The diagnosis as a finding; `used`: indices of the views of the solution."""
    cause = diagnosis.cause
    before, after = _lessened(diagnosis)
    message = f"{cause.message}. {DISAGREE} by {before} as they came, by {after} with this explanation"
    other = diagnosis.runner_up
    if other is not None and diagnosis.runner_up_gain > diagnosis.gain - MIN_LOG_LIKELIHOOD_GAIN:
        message += f". Nearly as likely: {other.message}"
    return (Finding(cause.code, severity_of(diagnosis, used), message, cause.fix),)


def comparison_text(finding: Finding) -> str:
    """The part of a finding's message that compares the session without and with the explanation."""
    return DISAGREE + finding.message.partition(DISAGREE)[2]


def severity_of(diagnosis: Diagnosis, used: Set[int]) -> Severity:
    """Severity of the cause: an error when it affects the `used` views, otherwise a warning."""
    cause = diagnosis.cause
    if cause.whole_session:
        return "error"
    if cause.code in CHANGE_CODES:
        before = {index for index in used if index < cause.where[0]}
        return "error" if before and used - before else "warning"
    if cause.code == "wrong-pitch":
        return "error" if abs(cause.size - 1) > MAX_PRINT_SCALE_ERROR else "warning"
    return "warning"


def lens_findings(misfit: LensMisfit) -> tuple[Finding, ...]:
    """The finding that the given intrinsics do not fit."""
    matrix = misfit.camera.matrix
    return (
        Finding(
            "intrinsics-do-not-fit",
            "error" if misfit.share > MAX_LENS_SHARE else "warning",
            f"the given intrinsics leave {misfit.before_px:.3f} px where others leave {misfit.after_px:.3f} px"
            f" (fx {matrix[0, 0]:.1f}, fy {matrix[1, 1]:.1f}, cx {matrix[0, 2]:.1f}, cy {matrix[1, 2]:.1f});"
            f" they misplace the target by {100 * misfit.share:.2f} % of its distance",
            "calibrate the camera as it is focused now, or leave the intrinsics out to have them estimated",
        ),
    )


def _lessened(diagnosis: Diagnosis) -> tuple[str, str]:
    """The disagreement before and after, in the units in which the explanation lessens it."""
    both = (
        (diagnosis.before_mm, diagnosis.after_mm, "{:.3g} mm"),
        (float(np.degrees(diagnosis.before_rad)), float(np.degrees(diagnosis.after_rad)), "{:.2g} deg"),
    )
    less = [(text.format(before), text.format(after)) for before, after, text in both if after < before]
    before, after = (" and ".join(sizes) for sizes in zip(*less, strict=True))
    return before, after
