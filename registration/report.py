"""Registers a scan, writes the merged cloud and builds the report; measures the gaps between its views."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import combinations
from pathlib import Path

import numpy as np

from calibration.documents.calibration import CorrectionDocument, FindingDocument, VerdictDocument
from calibration.documents.pose import PoseDocument
from calibration.sentences.sentence import from_one
from calibration.transforms import Array
from registration.documents import (
    DeviationDocument,
    RegisteredViewDocument,
    RegistrationReportDocument,
    Seconds,
    StitchedPairDocument,
    StitchingDocument,
)
from registration.errors import ScanError
from registration.fusion.concatenation import MergedCloud, PlacedCloud, merge_clouds
from registration.fusion.merging import EVERY_POINT, Merge
from registration.fusion.pose_adjustment import ViewCorrection
from registration.fusion.stitching import StitchingGap, measure_gap
from registration.points.range_check import FIX
from registration.points.surface import limit_of
from registration.scan import (
    Registration,
    ScannerMount,
    ScanView,
    ViewSample,
    register_views,
    sample_views,
    write_views,
)


def register_scan(
    views: list[ScanView],
    hand: ScannerMount,
    out: Path,
    clock: Callable[[], float],
    *,
    refine: bool = False,
    merge: Merge = EVERY_POINT,
    views_out: Path | None = None,
    further: Sequence[FindingDocument] = (),
    force: bool = False,
) -> RegistrationReportDocument:
    """Register, write the merged cloud to `out` (completely or not at all), report. `clock` gives seconds.

    With `views_out`, an existing folder, also write each registered view; `further` findings stand in the report.
    Clouds whose unit cannot be are refused unless `force`. Raises RegistrationError's leaves.
    """
    began = clock()
    samples = sample_views(views, limit=limit_of(len(views), refine=refine))
    doubts = unit_findings(samples)
    if doubts and not force:
        raise ScanError(doubts[0].message, doubts[0].fix)
    sampled = clock()
    registration = register_views(views, samples, hand, refine=refine)
    registered = clock()
    clouds = [PlacedCloud(placed.view.path, placed.view.unit, placed.base_T_camera) for placed in registration.views]
    merged = merge_clouds(clouds, out, merge=merge)
    if views_out is not None:
        write_views(registration.views, views_out)
    seconds = Seconds(read=sampled - began, register=registered - sampled, write=clock() - registered)
    findings = [*further, *doubts, *column_findings(merged.columns_lost), *_outliers(merged)]
    return report_of(registration, hand, merged.points, seconds, findings)


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
        findings.append(_finding("no-points", "error", what, "scan where the part is within the scanner's range"))
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
        findings.append(_finding("view-alone", "warning", what, "add views between, so that surfaces are seen twice"))
    empty = [index for index, view in enumerate(registration.views) if view.points == view.non_finite]
    if empty:
        findings.append(_finding("view-empty", "warning", f"views {from_one(empty)} have no points", "scan them again"))
    non_finite = sum(view.non_finite for view in registration.views)
    if non_finite:
        of = sum(view.points for view in registration.views)
        what = f"{non_finite} of {of} points are not finite, or 0, 0, 0, and are left out of the merged cloud"
        findings.append(_finding("points-not-finite", "info", what, "none needed: the scanner saw nothing there"))
    refinement = registration.refinement
    if refinement:
        far = [index for index, found in enumerate(refinement.corrections) if not found.explained]
        if far:
            noise = f"{hand.noise.translation_mm:.3g} mm, {np.rad2deg(hand.noise.rotation_rad):.2g} deg"
            what = f"views {from_one(far)} were moved further than three times the robot's noise ({noise}) explains"
            fix = "check the calibration, and that the part stood still"
            findings.append(_finding("correction-unexplained", "warning", what, fix))
        if not refinement.converged:
            what = f"the refinement had not settled after {refinement.iterations} iterations"
            findings.append(
                _finding("not-settled", "warning", what, "check for parts that moved, or too little overlap")
            )
    return findings


def column_findings(lost: Sequence[str]) -> list[FindingDocument]:
    """Finding about columns that only some views have; empty without any."""
    if not lost:
        return []
    what = f"the columns {', '.join(lost)} are not in every view, or not in this format, and were left out"
    return [_finding("columns-dropped", "warning", what, "scan every view with the same settings, and write a PLY")]


def unit_findings(samples: Sequence[ViewSample]) -> list[FindingDocument]:
    """Finding about views whose unit cannot be; empty without any."""
    doubted = [index for index, sample in enumerate(samples) if sample.doubt is not None]
    if not doubted:
        return []
    what = f"views {from_one(doubted)}: {samples[doubted[0]].doubt}"
    return [_finding("unit-impossible", "error", what, FIX)]


def _outliers(merged: MergedCloud) -> list[FindingDocument]:
    if not merged.outliers:
        return []
    what = f"{merged.outliers} of {merged.averaged} averaged points stand alone and were left out"
    return [_finding("outliers-left-out", "info", what, "none needed; --outliers keep writes them, too")]


def _finding(code: str, severity: str, message: str, fix: str) -> FindingDocument:
    return FindingDocument.model_validate({"code": code, "severity": severity, "message": message, "fix": fix})


def stitch_views(views: Sequence[ScanView], mount: ScannerMount, reach_mm: float | None = None) -> StitchingDocument:
    """The gaps between all views that overlap, placed by robot and calibration; `reach_mm` as of `measure_gap`.

    Raises CloudError's leaves, UnitUnknown, MotionError; ScanError when no two views show the same surface.
    """
    samples = sample_views(views)
    placed = register_views(views, samples, mount).views
    pairs: list[StitchedPairDocument] = []
    for first, second in combinations(range(len(views)), 2):
        poses = placed[first].base_T_camera, placed[second].base_T_camera
        with suppress(ScanError):  # these two have no surface in common
            found = measure_gap(samples[first].surface, poses[0], samples[second].surface, poses[1], reach_mm)
            pairs.append(_stitched(first, second, found))
    if not pairs:
        fix = "scan one surface from several views, or look further with reach_mm"
        raise ScanError("no two views show the same surface", fix)
    largest_mm = max(max(abs(pair.gap_mm), pair.offset_mm) for pair in pairs)
    return StitchingDocument(calibration_id=mount.calibration_id, largest_mm=largest_mm, pairs=tuple(pairs))


def _stitched(first: int, second: int, found: StitchingGap) -> StitchedPairDocument:
    return StitchedPairDocument.model_validate(
        {
            "views": [first, second],
            "gap_mm": round(found.gap_mm, 6),
            "width_mm": round(found.width_mm, 6),
            "base_offset_mm": found.base_offset_mm.round(6).tolist(),
            "offset_mm": round(float(np.linalg.norm(found.base_offset_mm)), 6),
            "directions": found.directions.round(6).tolist(),
            "sigma_mm": found.sigma_mm.round(6).tolist(),
            "pairs": found.pairs,
            "overlap": round(found.overlap, 4),
        }
    )
