"""The report of a scanner's verification with a sphere or a ball bar."""

from collections.abc import Iterator
from dataclasses import dataclass

from calibration.documents.reports.blocks import facts, identification, page, signatures, table, verdict
from calibration.documents.reports.charts import Bar, bar_chart
from calibration.documents.reports.context import ReportContext
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.numbers import DASH, number, significant


@dataclass(frozen=True)
class MeasuredBall:
    """One ball in one position: its centre in the scanner's frame, form and size error in mm, points of its surface."""

    centre_mm: tuple[float, float, float]
    form_mm: float
    size_mm: float
    points: int


@dataclass(frozen=True)
class MeasuredPosition:
    """What one view shows of the artefact; `spacing_error_mm` is None for a single sphere."""

    view: int
    balls: tuple[MeasuredBall, ...]
    spacing_error_mm: float | None


@dataclass(frozen=True)
class ScannerVerification:
    """Form, size and sphere-spacing error, each the largest of all positions; `spacing_mm` None for a single sphere."""

    acceptance_id: str
    at: str
    by: str
    scan_id: str
    based_on: str
    radius_mm: float
    spacing_mm: float | None
    form_mm: float
    size_mm: float
    spacing_error_mm: float | None
    positions: tuple[MeasuredPosition, ...]


def acceptance_report(measured: ScannerVerification, context: ReportContext) -> str:
    """The report as HTML. There are no limits in it: they are those of the scanner's data sheet or of the plant."""
    text = f"Probing error: form {significant(measured.form_mm)} mm, size {significant(measured.size_mm)} mm."
    if measured.spacing_error_mm is not None:
        text += f" Sphere spacing {significant(measured.spacing_error_mm)} mm."
    made = f"{measured.at}, by {measured.by}, scan {measured.scan_id}"
    sections = [
        ("Identification", identification(context, "", made)),
        ("Artefact and method", _method(measured)),
        ("Result", _result(measured)),
        ("Positions", _positions(measured)),
        ("Release", signatures(context)),
    ]
    lead = [verdict(True, "Measured.", text)]
    return page("Acceptance report", "probing and spacing of the scanner", measured.acceptance_id, lead, sections)


def _method(measured: ScannerVerification) -> Markup:
    kind = "A sphere" if measured.spacing_mm is None else "A ball bar"
    about = (
        f"{kind} is scanned in {len(measured.positions)} positions. Form: the width that holds 95 % of the distances"
        " from the fitted sphere. Size: its diameter less the calibrated one. Spacing: the centres' distance less the"
        f" calibrated one. {measured.based_on}."
    )
    known = [("Radius", f"{measured.radius_mm:g} mm")]
    if measured.spacing_mm is not None:
        known.append(("Distance of centres", f"{measured.spacing_mm:g} mm"))
    return join(tag("p", about), facts(known))


def _result(measured: ScannerVerification) -> Markup:
    rows = [
        ("probing error, form", number(measured.form_mm, 4)),
        ("probing error, size", number(measured.size_mm, 4)),
        ("sphere-spacing error", number(measured.spacing_error_mm, 4)),
    ]
    bars = [
        Bar(str(position.view), max((ball.form_mm for ball in position.balls), default=0.0))
        for position in measured.positions
    ]
    caption = tag("figcaption", "Form error of each position.")
    chart = tag("figure", bar_chart(bars, "mm", "form error of each position"), caption) if bars else None
    return join(table(("the largest of all positions", "mm"), rows), chart)


def _positions(measured: ScannerVerification) -> Markup:
    head = ("position", "ball", "x / mm", "y / mm", "z / mm", "points", "form / mm", "size / mm", "spacing / mm")
    return table(head, _rows(measured.positions))


def _rows(positions: tuple[MeasuredPosition, ...]) -> Iterator[tuple[object, ...]]:
    for position in positions:
        for index, ball in enumerate(position.balls):
            spacing = number(position.spacing_error_mm, 4) if index == 0 else DASH
            yield (
                position.view if index == 0 else "", index + 1, *(number(value, 2) for value in ball.centre_mm),
                ball.points, number(ball.form_mm, 4), number(ball.size_mm, 4), spacing,
            )  # fmt: skip
