"""The report of a scan: the merged cloud from three sides, and how its views agree."""

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.documents.calibration import FindingDocument
from calibration.documents.reports.blocks import (
    findings,
    identification,
    page,
    picture,
    signatures,
    table,
    verdict,
)
from calibration.documents.reports.charts import Bar, bar_chart
from calibration.documents.reports.context import Picture, ReportContext
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.numbers import DASH, MINUS, significant


@dataclass(frozen=True)
class ScannedView:
    """One view: its points, the share that others see, and its deviation from them, one RMS in mm."""

    index: int
    points: int
    overlap: float
    rms_mm: float | None
    correction_mm: float | None = None


@dataclass(frozen=True)
class DeviationMap:
    """How far each point lies from the other views, mm, positive towards its camera.

    `picture`: coloured up to `end_mm`; `shares`: of the points that several views see, around each of `middles_mm`;
    `alone`: share of the points that one view only sees.
    """

    picture: Picture
    end_mm: float
    middles_mm: tuple[float, ...]
    shares: tuple[float, ...]
    rms_mm: float
    alone: float


@dataclass(frozen=True)
class Scan:
    """A registered scan. `before_mm`, `after_mm`: point-to-plane RMS between overlapping views; `after_mm` is None
    without refinement. `pictures`: the merged cloud from three sides."""

    scan_id: str
    name: str
    at: str
    calibration_id: str
    points: int
    views: tuple[ScannedView, ...]
    before_mm: float | None
    after_mm: float | None
    accepted: bool
    findings: Sequence[FindingDocument] = ()
    pictures: tuple[Picture, ...] = ()
    deviations: DeviationMap | None = None


def scan_report(scan: Scan, context: ReportContext) -> str:
    """The report as HTML."""
    agreed = scan.after_mm if scan.after_mm is not None else scan.before_mm
    text = f"{scan.points:,} points of {len(scan.views)} views in the robot's base."
    if agreed is not None:
        text += f" Overlapping views agree to {significant(agreed)} mm (RMS, point to plane)."
    rows = [
        (view.index, view.points, f"{view.overlap:.0%}", significant(view.rms_mm), significant(view.correction_mm))
        for view in scan.views
    ]
    head = ("view", "points", "seen by others", "deviation / mm", "pose corrected by / mm")
    bars = [Bar(str(view.index), view.rms_mm) for view in scan.views if view.rms_mm is not None]
    caption = tag("figcaption", "Deviation of each view from the others where they overlap.")
    chart = tag("figure", bar_chart(bars, "mm", "deviation of each view"), caption) if bars else None
    shown = tag("div", *(picture(each) for each in scan.pictures), class_="columns") if scan.pictures else None
    before, after = significant(scan.before_mm), significant(scan.after_mm)
    method = (
        f"Each cloud is placed by the robot's pose and calibration {scan.calibration_id}"
        + ("." if scan.after_mm is None else ", then refined under the robot's noise.")
        + f" Deviation of overlapping views: {before} mm by the poses, "
        + ("not refined." if after == DASH else f"{after} mm refined.")
    )
    sections = [
        ("Identification", identification(context, "", f"{scan.at}, scan {scan.scan_id}, {scan.name}")),
        ("Method", tag("p", method)),
        ("Cloud", join(shown, None if shown else tag("p", "No picture."))),
        ("Registration", join(chart, table(head, rows))),
        ("Deviation map", _deviations(scan.deviations)),
        ("Findings", findings(scan.findings)),
        ("Release", signatures(context)),
    ]
    lead = [verdict(scan.accepted, "Registered." if scan.accepted else "Not accepted.", text)]
    return page("Scan report", "merged cloud of a part", scan.scan_id, lead, sections)


def _deviations(found: DeviationMap | None) -> Markup:
    if found is None:
        return tag("p", "None: no two views see the same place.")
    end = significant(found.end_mm)
    text = (
        f"Root mean square {significant(found.rms_mm)} mm over the points that several views see;"
        f" {100 * found.alone:.0f} % of the points are seen by one view only."
    )
    colours = (
        f" Blue: behind the other views, by {end} mm or more where it is darkest; light grey: where they are; red:"
        f" before them; dark grey: seen by one view only."
    )
    bars = [Bar(_signed(middle), 100 * share) for middle, share in zip(found.middles_mm, found.shares, strict=True)]
    shares = tag(
        "figure",
        bar_chart(bars, "%", "share of the points by their deviation"),
        tag("figcaption", f"Share of the points by their deviation in mm; the outermost hold all beyond {end} mm."),
    )
    return join(tag("p", text, colours), picture(found.picture), shares)


def _signed(value_mm: float) -> str:
    return "0" if abs(value_mm) < 1e-9 else f"{value_mm:+.2g}".replace("-", MINUS)
