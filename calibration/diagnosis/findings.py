"""A diagnosis as findings: the cause, the robot noise without and with it, and the fix."""

from collections.abc import Set
from dataclasses import replace

import numpy as np

from calibration.camera import CameraModel
from calibration.diagnosis.diagnose import MIN_LOG_LIKELIHOOD_GAIN, Diagnosis
from calibration.diagnosis.intrinsics_check import LensMisfit
from calibration.diagnosis.view_hypotheses import CHANGE_CODES
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, Severity

MIN_PICTURE_SCALE_ERROR, MAX_ASPECT_CHANGE, MAX_CENTRE_OFF = 0.1, 0.02, 0.04
"""Intrinsics of pictures of another size: least change of scale; most change of fx / fy, and of the centre as a share
of the picture's size."""


def diagnosis_findings(
    diagnosis: Diagnosis, used: Set[int] = frozenset(), effect_mm: float | None = None
) -> tuple[Finding, ...]:
    """The diagnosis as a finding; `used`: indices of the views of the solution.

    `effect_mm`: by how much a measured point moves with the explanation, None where that is not known.
    """
    cause = diagnosis.cause
    before, after = _lessened(diagnosis)
    comparison = Sentence("comparison", before=before, after=after)
    if effect_mm:  # 0 where the solution takes the cause into account already
        comparison = Sentence("comparison-moving", comparison=comparison, effect_mm=effect_mm)
    message = Sentence("explained", finding=cause.message, comparison=comparison)
    other = diagnosis.runner_up
    if other is not None and diagnosis.runner_up_gain > diagnosis.gain - MIN_LOG_LIKELIHOOD_GAIN:
        message = Sentence("explained-or", **message.params, other=other.message)
    sizes = (("print_scale_share", cause.size - 1),) if cause.code == "wrong-pitch" else ()
    return (Finding(cause.code, severity_of(diagnosis, used), message, cause.fix, effect_mm, sizes),)


def with_comparison(finding: Finding, diagnosed: Finding) -> Finding:
    """`finding` with the comparison of the session without and with the explanation, of a finding of the diagnosis."""
    assert isinstance(diagnosed.message, Sentence)
    return replace(finding, message=Sentence("explained", **diagnosed.message.params | {"finding": finding.message}))


def severity_of(diagnosis: Diagnosis, used: Set[int]) -> Severity:
    """Severity of the cause: an error when it affects the `used` views, otherwise a warning."""
    cause = diagnosis.cause
    if cause.whole_session:
        return "error"
    if cause.code in CHANGE_CODES:
        before = {index for index in used if index < cause.where[0]}
        return "error" if before and used - before else "warning"
    return "error" if cause.code == "wrong-pitch" else "warning"


def lens_findings(
    misfit: LensMisfit, given: CameraModel, agrees_better: bool, effect_mm: float | None = None
) -> tuple[Finding, ...]:
    """The finding that the `given` intrinsics do not fit.

    `agrees_better`: whether robot and images agree better with the others; if not, the target's shape or the light may
    be what the pixels show. `effect_mm`: by how much a point moves with the others from where the solution puts
    it, in which only a few of them are unknown; None where those fit as well.
    """
    matrix, factor = misfit.camera.matrix, _picture_scale(misfit.camera, given)
    message = Sentence(
        "intrinsics-do-not-fit" if factor is None else "intrinsics-of-another-size",
        before_px=misfit.before_px,
        after_px=misfit.after_px,
        fx=matrix[0, 0],
        fy=matrix[1, 1],
        cx=matrix[0, 2],
        cy=matrix[1, 2],
        percent=100 * misfit.share,
        **({} if factor is None else {"times": 1 / factor}),
    )
    sizes = [("lens_share", misfit.share)]
    if effect_mm is not None:
        sizes.append(("tolerance_mm", effect_mm))
        message = Sentence("lens-moving", finding=message, effect_mm=effect_mm)
    return (
        Finding(
            "intrinsics-do-not-fit",
            "error" if agrees_better else "warning",
            message,
            Sentence("calibrate-camera-in-focus") if factor is None else Sentence("scale-intrinsics", factor=factor),
            effect_mm=effect_mm,
            sizes=tuple(sizes),
            least="warning",
        ),
    )


def _picture_scale(found: CameraModel, given: CameraModel) -> float | None:
    """The factor between the pictures and those that the `given` intrinsics are of; None when they differ otherwise.

    A picture scaled by s has s fx, s fy, s (cx + 1/2) - 1/2, s (cy + 1/2) - 1/2.
    """
    factors = np.diagonal(found.matrix)[:2] / np.diagonal(given.matrix)[:2]
    factor = float(np.mean(factors))
    centre_px = factor * (given.matrix[:2, 2] + 0.5) - 0.5
    off_px = np.abs(centre_px - found.matrix[:2, 2]).max()
    alike = np.ptp(factors) < MAX_ASPECT_CHANGE * factor and off_px < MAX_CENTRE_OFF * max(given.image_size)
    return factor if alike and abs(factor - 1) > MIN_PICTURE_SCALE_ERROR else None


def _lessened(diagnosis: Diagnosis) -> tuple[list[Sentence], list[Sentence]]:
    """The disagreement before and after, in the units in which the explanation lessens it."""
    first, then = diagnosis.before, diagnosis.after
    both = (
        (first.translation_mm, then.translation_mm, "size-mm"),
        (float(np.degrees(first.rotation_rad)), float(np.degrees(then.rotation_rad)), "size-deg"),
    )
    less = [(before, after, size) for before, after, size in both if after < before]
    return (
        [Sentence(size, value=before) for before, _, size in less],
        [Sentence(size, value=after) for _, after, size in less],
    )
