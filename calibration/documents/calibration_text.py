"""A calibration as plain text, as `solve` and `calibrate` print it."""

from collections import Counter
from collections.abc import Iterable

from calibration.documents.calibration import AccuracyDocument, CalibrationDocument, FindingDocument
from calibration.documents.numbers import significant
from calibration.documents.pose import PoseDocument

MARKS = {"error": "✗", "warning": "!", "info": "·"}
TRANSFORMS = ("flange_T_camera", "base_T_target", "base_T_camera", "flange_T_target")


def summary(title: str, document: CalibrationDocument) -> str:
    """A calibration in about a dozen lines, the verdict first."""
    return "\n".join([f"{title}  {verdict_word(document)}", *(f"  {line}" for line in _lines(document))])


def verdict_word(document: CalibrationDocument) -> str:
    """`accepted`, `not accepted`, or `refused` when there is no transform."""
    if document.verdict.accepted:
        return "accepted"
    return "not accepted" if document.flange_T_camera or document.base_T_camera else "refused"


def accuracy_text(accuracy: AccuracyDocument) -> str:
    """U = 0.23 mm (k = 2) at far top left; tolerance 1 mm, not stated by you; expected 0.18 mm; before 0.52 mm

    Followed by the reason where found and expected U part.
    """
    at = "" if accuracy.worst_point is None else f" at {accuracy.worst_point}"
    parts = [
        "U is not known" if accuracy.expanded_mm is None else f"U = {significant(accuracy.expanded_mm)} mm (k = 2){at}"
    ]
    if accuracy.tolerance_mm is not None:
        stated = "" if accuracy.tolerance_stated else ", not stated by you"
        parts.append(f"tolerance {accuracy.tolerance_mm:g} mm{stated}")
    for name, value_mm in (("expected", accuracy.expected_mm), ("before", accuracy.before_mm)):
        if value_mm is not None:
            parts.append(f"{name} {significant(value_mm)} mm")
    return "; ".join(parts if accuracy.why is None else [*parts, accuracy.why.message])


def _lines(document: CalibrationDocument) -> Iterable[str]:
    yield f"{'accuracy':<16} {accuracy_text(document.accuracy)}"
    for name in TRANSFORMS:
        pose: PoseDocument | None = getattr(document, name)
        if pose is not None:
            translation, quaternion = _numbers(pose.translation_mm, ".3f"), _numbers(pose.quaternion_wxyz, ".6f")
            yield f"{name:<16} {translation} mm   {quaternion} wxyz"
    if document.uncertainty is not None:
        yield (
            f"{'uncertainty':<16} translation {_numbers(document.uncertainty.translation_mm, '.3g')} mm,"
            f" rotation {_numbers(document.uncertainty.rotation_deg, '.2g')} deg (one standard deviation)"
        )
    if document.hold_out is not None:
        pixels = document.hold_out.reprojection_px
        in_image = "" if pixels is None else f", {pixels:.3g} px"
        base_error_mm = f"{document.hold_out.base_error_mm:.3g} mm in the base"
        yield f"{'hold-out':<16} {base_error_mm}{in_image} (each picture left out in turn)"
    yield f"{'noise found':<16} {_noise(document)}"
    yield f"{'pictures':<16} {_views(document)}"
    observability = document.observability
    yield (
        f"{'motion':<16} up to {observability.max_rotation_deg:.0f} deg, axis spread {observability.axis_spread:.2f};"
        f" weakest: {observability.weakest_direction}"
    )
    yield f"{'method':<16} {document.method}"
    yield from (finding_line(finding) for finding in document.verdict.findings)


def finding_line(finding: FindingDocument) -> str:
    """A finding: a mark of its severity and the message; the fix on a second line."""
    return f"{MARKS[finding.severity]} {finding.message}" + (f"\n    -> {finding.fix}" if finding.fix else "")


def _numbers(values: Iterable[float], form: str) -> str:
    return "(" + ", ".join(format(value, form) for value in values) + ")"


def _noise(document: CalibrationDocument) -> str:
    noise = document.noise
    parts = (
        ("image", noise.image_px, "px"),
        ("robot", noise.robot_translation_mm, "mm"),
        ("robot", noise.robot_rotation_deg, "deg"),
    )
    found = [f"{what} {value:.2g} {unit}" for what, value, unit in parts if value is not None]
    return ", ".join(found) or "not from so few pictures"


def _views(document: CalibrationDocument) -> str:
    counts = Counter(view.status for view in document.views)
    text = ", ".join(f"{counts[status]} {status}" for status in ("used", "corrected", "rejected") if counts[status])
    reasons = Counter(view.reason for view in document.views if view.status == "rejected" and view.reason)
    return text + (f" ({', '.join(f'{count} {reason}' for reason, count in reasons.most_common())})" if reasons else "")
