"""Reports of a verification and of the control chart."""

from calibration.documents.reports.blocks import identification, page, signatures, table, verdict
from calibration.documents.reports.charts import ChartPoint, control_chart
from calibration.documents.reports.context import Drift, ReportContext, VerifiedPoints
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.numbers import DASH, number, significant

ALARMING = ("drifting", "out-of-tolerance")


def verification_report(verified: VerifiedPoints, context: ReportContext) -> str:
    """A verification as HTML: Tab. 1 of Song et al., the points of the target seen from several positions."""
    made = f"{verified.at}, run {verified.run_id}"
    worst = max(verified.sigma_mm)
    expected = verified.expected_mm
    text = f"{verified.points} points of the target from {verified.stations} positions: standard deviation"
    text += f" {significant(worst)} mm along the worst axis."
    if expected is not None:
        text += f" The calibration states {significant(expected)} mm for a mapped point (one standard deviation)."
    method = (
        "The target stays where it is; the arm looks at it from several positions, and calibration"
        f" {verified.calibration_id} maps its points into the base. Their standard deviation over the positions is what"
        " robot, camera and calibration leave together."
    )
    chart = drift_block(context.drift) if context.drift and context.drift.points else tag("p", "No chart yet.")
    sections = [
        ("Identification", identification(context, "", made)),
        ("Measurand and method", tag("p", method)),
        ("Result", join(verified_block(verified), _positions(verified))),
        ("Drift since the calibration was put in force", chart),
        ("Release", signatures(context)),
    ]
    drifting = context.drift is not None and context.drift.alarm is not None
    lead = verdict(not drifting, "Drifting." if drifting else "Verified.", text)
    return page("Verification report", "points of a fixed target", verified.run_id, [lead], sections)


def verified_block(verified: VerifiedPoints) -> Markup:
    """Standard deviations over the positions."""
    rows = [(name, *(number(value, 4) for value in sigma)) for name, sigma in verified.rows]
    rows.append((f"all {verified.points} points", *(number(value, 4) for value in verified.sigma_mm)))
    head = (f"standard deviation over {verified.stations} positions / mm", "x", "y", "z")
    expected = (
        None
        if verified.expected_mm is None
        else tag("p", f"Expected by the calibration: {significant(verified.expected_mm)} mm for a mapped point"
                      f" (one standard deviation). Run {verified.run_id}, {verified.at}.", class_="small")
    )  # fmt: skip
    return join(table(head, rows), expected)


def _positions(verified: VerifiedPoints) -> Markup | None:
    """The points of the cross in the base, from each position."""
    if not verified.positions:
        return None
    rows = [
        (name if index == 0 else "", index + 1, *(number(value, 3) for value in place))
        for name, places in verified.positions
        for index, place in enumerate(places)
    ]
    return table(("point", "position", "x / mm", "y / mm", "z / mm"), rows)


def drift_report(drift: Drift, context: ReportContext) -> str:
    """The control chart as HTML."""
    first, last = (drift.points[0].at, drift.points[-1].at) if drift.points else (DASH, DASH)
    alarm = drift.alarm
    word = "Alarm." if alarm else f"{drift.standing.capitalize()}."
    text = alarm or f"{len(drift.points)} verifications from {first} to {last}, none beyond the limit."
    rows = [
        (point.at, point.run_id, point.standing, number(point.drift_mm, 3), number(point.limit_mm, 3),
         number(point.scatter_mm, 3))
        for point in drift.points
    ]  # fmt: skip
    head = ("verified", "run", "standing", "drift / mm", "limit / mm", "scatter / mm")
    chart = drift_block(drift) if drift.points else tag("p", "No verification yet.")
    sections = [
        ("Identification", identification(context, "", f"calibration {drift.calibration_id}")),
        ("Control chart", chart),
        ("Verifications", table(head, rows) if rows else tag("p", "None.")),
        ("Release", signatures(context)),
    ]
    lead = [verdict(not alarm, word, text)]
    return page(
        "Drift report",
        "control chart of the calibration in force",
        f"{drift.calibration_id} drift {last}",
        lead,
        sections,
    )


def drift_block(drift: Drift) -> Markup:
    """The control chart, with its words."""
    points = [
        ChartPoint(point.at[:16].replace("T", " "), point.drift_mm, point.limit_mm, point.standing in ALARMING)
        for point in drift.points
    ]
    chart = control_chart(points, "mm", "drift of the target since the calibration was put in force")
    words = (
        "Drift of the target, moving average, since the calibration was put in force; dashed: its limit by chance."
        f" Standing: {drift.standing}."
    )
    changed = [tag("li", change) for change in drift.changes]
    known = tag("ul", *changed, title="what may have changed") if changed else None
    return join(tag("figure", chart, tag("figcaption", words)), known)
