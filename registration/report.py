"""The report of a registration, and its findings."""

from collections.abc import Sequence

import numpy as np

from calibration.documents.calibration import CorrectionDocument, FindingDocument, VerdictDocument
from calibration.documents.pose import PoseDocument
from calibration.sentences.sentence import from_one
from calibration.transforms import Array
from registration.documents import DeviationDocument, RegisteredViewDocument, RegistrationReportDocument, Seconds
from registration.fusion.pose_adjustment import ViewCorrection
from registration.points.range_check import FIX
from registration.scan import Registration, ScannerMount, ViewSample


def report_of(
    registration: Registration,
    hand: ScannerMount,
    points: int,
    seconds: Seconds,
    further: Sequence[FindingDocument] = (),
) -> RegistrationReportDocument:
    """Report of a registration, with `further` findings of the merge."""
    findings = [*_findings(registration, hand), *further]
    if not points:
        what = f"the merged cloud of {len(registration.views)} views has no points"
        findings.append(finding("no-points", "error", what, "scan where the part is within the scanner's range"))
    after = registration.after
    return RegistrationReportDocument(
        calibration_id=hand.calibration_id,
        views=[_view(registration, index) for index in range(len(registration.views))],
        points=points,
        rms_mm=DeviationDocument(before=registration.before.rms_mm, after=after.rms_mm if after else None),
        seconds=seconds,
        verdict=VerdictDocument(accepted=all(found.severity != "error" for found in findings), findings=findings),
    )


def _view(registration: Registration, index: int) -> RegisteredViewDocument:
    placed, agreed = registration.views[index], registration.after or registration.before
    correction = registration.refinement.corrections[index] if registration.refinement else None
    return RegisteredViewDocument(
        index=index,
        cloud=placed.view.path.name,
        points=placed.points,
        base_T_camera=PoseDocument.of(placed.base_T_camera),
        correction=_correction(correction) if correction else None,
        overlap=agreed.view_overlap[index],
        rms_mm=agreed.view_rms_mm[index],
        free_directions=[_words(twist) for twist in correction.free] if correction else [],
    )


def _correction(correction: ViewCorrection) -> CorrectionDocument:
    translation, rotation = correction.translation_mm.tolist(), np.rad2deg(correction.rotation_rad).tolist()
    return CorrectionDocument(translation_mm=tuple(translation), rotation_deg=tuple(rotation))


def _words(twist: Array) -> str:
    """A unit twist [rotation × radius, translation] in base, described by its larger half."""
    turning, sliding = np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:])
    kind, axis = ("rotation about", twist[:3]) if turning > sliding else ("translation along", twist[3:])
    x, y, z = axis / np.linalg.norm(axis)
    return f"{kind} ({x:.2f}, {y:.2f}, {z:.2f})"


def _findings(registration: Registration, hand: ScannerMount) -> list[FindingDocument]:
    findings: list[FindingDocument] = []
    agreed = registration.after or registration.before
    alone = [index for index, overlap in enumerate(agreed.view_overlap) if not overlap]
    if alone and len(registration.views) > 1:
        what = f"views {from_one(alone)} overlap no other; they keep the robot's pose"
        findings.append(finding("view-alone", "warning", what, "add views between, so that surfaces are seen twice"))
    empty = [index for index, view in enumerate(registration.views) if view.points == view.non_finite]
    if empty:
        findings.append(finding("view-empty", "warning", f"views {from_one(empty)} have no points", "scan them again"))
    non_finite = sum(view.non_finite for view in registration.views)
    if non_finite:
        of = sum(view.points for view in registration.views)
        what = f"{non_finite} of {of} points are not finite, or 0, 0, 0, and are left out of the merged cloud"
        findings.append(finding("points-not-finite", "info", what, "none needed: the scanner saw nothing there"))
    refinement = registration.refinement
    if refinement:
        far = [index for index, found in enumerate(refinement.corrections) if not found.explained]
        if far:
            noise = f"{hand.noise.translation_mm:.3g} mm, {np.rad2deg(hand.noise.rotation_rad):.2g} deg"
            what = f"views {from_one(far)} were moved further than three times the robot's noise ({noise}) explains"
            fix = "check the calibration, and that the part stood still"
            findings.append(finding("correction-unexplained", "warning", what, fix))
        if not refinement.converged:
            what = f"the refinement had not settled after {refinement.iterations} iterations"
            findings.append(
                finding("not-settled", "warning", what, "check for parts that moved, or too little overlap")
            )
    return findings


def column_findings(lost: Sequence[str]) -> list[FindingDocument]:
    """Finding about columns that only some views have; empty without any."""
    if not lost:
        return []
    what = f"the columns {', '.join(lost)} are not in every view, or not in this format, and were left out"
    return [finding("columns-dropped", "warning", what, "scan every view with the same settings, and write a PLY")]


def unit_findings(samples: Sequence[ViewSample]) -> list[FindingDocument]:
    """Finding about views whose unit cannot be; empty without any."""
    doubted = [index for index, sample in enumerate(samples) if sample.doubt is not None]
    if not doubted:
        return []
    what = f"views {from_one(doubted)}: {samples[doubted[0]].doubt}"
    return [finding("unit-impossible", "error", what, FIX)]


def finding(code: str, severity: str, message: str, fix: str) -> FindingDocument:
    """A finding without parameters."""
    return FindingDocument.model_validate({"code": code, "severity": severity, "message": message, "fix": fix})
