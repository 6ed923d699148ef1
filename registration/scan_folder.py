"""A folder with scan.json and its clouds: read, registered into one file, or measured for gaps between its views."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from calibration.documents.calibration import FindingDocument
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.external_axis import ExternalAxes
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document, parse_document
from calibration.kinematics.stance import Stance
from calibration.problem import Setup
from registration.documents import Positive, RegistrationReportDocument, Seconds
from registration.errors import ScanError
from registration.fusion.concatenation import MergedCloud, PlacedCloud, merge_clouds
from registration.fusion.merging import EVERY_POINT, Merge
from registration.fusion.stitching import StitchedPairDocument, measure_gap
from registration.io.convert import move_file
from registration.io.durable_file import GuardedFile
from registration.points.range_check import POSSIBLE_MM, range_of
from registration.points.rigid_motion import RigidMotion, Unit
from registration.points.surface import limit_of
from registration.report import column_findings, finding, report_of, unit_findings
from registration.scan import PlacedView, ScannerMount, ScanView, register_views, sample_views, setup_of

DOCUMENT_LIMIT = 1 << 26


class ScanViewDocument(Document):
    """One cloud, its flange pose, and the arm's axes there where they are known. `external_axes`: needed where the
    calibration has one."""

    cloud: str
    """Name of a cloud beside the document."""
    unit: Unit
    """Of the cloud's lengths: m or mm; never guessed."""
    base_T_flange: PoseDocument
    """The flange (tool0) in the base (wobj0): maps coordinates of the flange to the base, mm."""
    joints_deg: Annotated[tuple[float, ...], Field(min_length=1, max_length=12)] | None = None
    """Joint angles where they were recorded, degrees."""
    external_axes: ExternalAxes | None = None
    """The controller's axes beside the arm at the pose, mm or degrees; null for one it does not have."""


class ScanDocument(Document):
    """Content of scan.json."""

    heading = "scanjson"

    schema_version: Literal[1]
    """Version of the format."""
    source: str = ""
    """Where it came from, for people."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    range_mm: tuple[Positive, Positive] | None = None
    """Nearest and farthest at which the scanner measures, as its data sheet states; null where that is not known."""
    views: list[ScanViewDocument]
    """The clouds of one part."""


class StitchingDocument(Document):
    """The gaps between all views that overlap."""

    heading = "stitching"

    schema_version: Literal[1] = 1
    """Version of the format."""
    calibration_id: str
    """Of the calibration that was used."""
    largest_mm: float
    """Largest of the gaps and shifts, mm."""
    pairs: tuple[StitchedPairDocument, ...]
    """The pairs of views that overlap."""


def read_scan(folder: Path) -> list[ScanView]:
    """Views of a folder's scan.json. Raises CloudIOError, DocumentError, ScanError."""
    path = folder / "scan.json"
    with GuardedFile.reading(path, str(path)) as file:
        document = parse_document(ScanDocument, file.read(min(DOCUMENT_LIMIT, path.stat().st_size)), str(path))
    if not document.views:
        raise ScanError(f"{path} has no views", "add at least one")
    for index, view in enumerate(document.views):
        if Path(view.cloud).name != view.cloud:
            raise ScanError(f"{path}: views[{index}].cloud leaves the folder", "name a file beside scan.json")
    return [
        ScanView(
            folder / view.cloud,
            view.unit,
            Stance.of_degrees(view.base_T_flange.transform(), view.joints_deg, view.external_axes),
            document.setup,
            range_of(document.range_mm),
        )
        for view in document.views
    ]


def place_views(calibration: CalibrationInUse, views: Sequence[ScanView]) -> list[ScanView]:
    """The views in the poses that the calibration gives to those reported. Raises as its `base_T_flange`."""
    poses = calibration.base_T_flange([view.stance for view in views])
    placed = [replace(view, stance=Stance(pose)) for view, pose in zip(views, poses, strict=True)]
    if calibration.arm is None or setup_of(views) == "eye-to-hand":
        return placed
    by_arm = range_of(None, calibration.arm.model.arm.reach_mm)
    return [replace(view, range_mm=by_arm) if view.range_mm == POSSIBLE_MM else view for view in placed]


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


def _outliers(merged: MergedCloud) -> list[FindingDocument]:
    if not merged.outliers:
        return []
    what = f"{merged.outliers} of {merged.averaged} averaged points stand alone and were left out"
    return [finding("outliers-left-out", "info", what, "none needed; --outliers keep writes them, too")]


def write_views(views: Sequence[PlacedView], folder: Path) -> list[Path]:
    """Write each view in base, in mm, under its own name in `folder`, with its format and columns.

    Raises CloudError's leaves, ScanError when `folder` is the scan's own.
    """
    targets = [folder / placed.view.path.name for placed in views]
    if any(target.resolve() == placed.view.path.resolve() for target, placed in zip(targets, views, strict=True)):
        raise ScanError(f"{folder} holds the scan itself", "name another folder for the registered views")
    for target, placed in zip(targets, views, strict=True):
        move_file(placed.view.path, target, RigidMotion.of(placed.base_T_camera, placed.view.unit))
    return targets


def stitch_views(views: Sequence[ScanView], mount: ScannerMount, reach_mm: float | None = None) -> StitchingDocument:
    """The gaps between all views that overlap, placed by robot and calibration; `reach_mm` as of `measure_gap`.

    Raises CloudError's leaves, UnitUnknown, MotionError; ScanError when no two views show the same surface.
    """
    samples = sample_views(views)
    placed = register_views(views, samples, mount).views
    pairs: list[StitchedPairDocument] = []
    for first, second in combinations(range(len(views)), 2):
        one, other = ((samples[index].surface, placed[index].base_T_camera) for index in (first, second))
        with suppress(ScanError):  # these two have no surface in common
            pairs.append(measure_gap((first, second), one, other, reach_mm))
    if not pairs:
        fix = "scan one surface from several views, or look further with reach_mm"
        raise ScanError("no two views show the same surface", fix)
    largest_mm = max(max(abs(pair.gap_mm), pair.offset_mm) for pair in pairs)
    return StitchingDocument(calibration_id=mount.calibration_id, largest_mm=largest_mm, pairs=tuple(pairs))
