"""Each report from its document, as HTML: what its template cannot compute.

Contents of the calibration report as ISO/IEC 17025:2017, 7.8.2 and 7.8.4; U = k u with k stated (JCGM 100, 7.2).
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.documents.arm_field import ArmFieldDocument
from calibration.documents.calibration import (
    TRANSFORM_NAMES,
    CalibrationDocument,
    PointUncertaintyDocument,
    UncertaintyDocument,
)
from calibration.documents.more_arm_views import BOX_STEPS
from calibration.documents.numbers import DASH, MINUS, places
from calibration.kinematics.conventions import numbers_of
from calibration.likelihood.mapped_points import point_rows, scale_variance_mm2
from calibration.monitoring.cell_change import DriftChangeDocument
from calibration.sentences.sentence import as_sentence, text_of
from calibration.transforms import Array
from daemon.reports.charts import Bar, Chart, ChartPoint, bar_chart, bubble_map, control_chart, limit_scale
from daemon.reports.context import DeviationMap, Picture, ReportContext
from daemon.reports.pages import language_of, render

if TYPE_CHECKING:  # the daemon's modules are on Linux only; `handeyed report` is not
    from daemon.drift.chart import DriftChart
    from daemon.model.records import RunRecord, ScanRecord
    from daemon.scans.scanner_acceptance import AcceptanceDocument
    from daemon.store.documents import DocumentRecord
    from registration.documents import RegistrationReportDocument

SHOWN_POINTS = 6
MIN_SHOWN_CHANCE = 0.05
"""Of what may have changed."""
ALARMING = ("drifting", "out-of-tolerance")


def calibration_report(document: CalibrationDocument, context: ReportContext) -> str:
    x, sure, noise = document.mount_T_camera, document.uncertainty, document.noise
    x_name, target_name = TRANSFORM_NAMES[document.setup]
    expanded_mm, tolerance_mm = document.accuracy.expanded_mm, document.accuracy.tolerance_mm
    limit = text_of("calibration.tolerance", {"tolerance_mm": tolerance_mm or 0.0}, language_of(context.language))
    U_mm = [2 * u for u in sure.translation_mm] if sure else [None] * 3
    U_deg = [2 * u for u in sure.rotation_deg] if sure else [None] * 3
    bars = [
        Bar(str(view.index + 1), view.base_error_mm, view.status == "rejected")
        for view in document.views
        if view.base_error_mm is not None
    ]
    return render(
        "calibration", document.id, context,
        document=document, x=x, x_name=x_name, target_name=target_name, U_mm=U_mm, U_deg=U_deg,
        translation=[] if x is None else [*zip(x.translation_mm, map(places, U_mm), strict=True)],
        angles_deg=[] if x is None else [*numbers_of("euler-xyz", x.transform()[:3, :3])],
        angle_places=places(max((u for u in U_deg if u is not None), default=None)),
        points=sorted(sure.points, key=lambda point: -point.expanded_mm)[:SHOWN_POINTS] if sure else [],
        scale=None if expanded_mm is None or tolerance_mm is None else limit_scale(expanded_mm, tolerance_mm, limit),
        bars=bar_chart(bars, "mm") if bars else None,
        sources=[
            ("budget.corners", noise.image_px, "px"),
            ("budget.robot-position", noise.robot_translation_mm, "mm"),
            ("budget.robot-orientation", noise.robot_rotation_deg, "\u00b0"),
        ],
        scale_percent=scale_percent(document), budget=budget_at_worst(sure),
        maps=_arm_maps(context.arm_field), arm_places=BOX_STEPS**3,
        verified=None if context.verification is None else _verified(context.verification), **_drift(context.drift),
    )  # fmt: skip


def _arm_maps(field: ArmFieldDocument | None) -> list[tuple[str, float, Chart]]:
    """Of the misses before and after, seen from above: a word, the largest in mm, and the map, both of one scale."""
    if field is None:
        return []
    above = defaultdict(list)
    for point in field.points:  # the flange's place is the same for points above each other
        above[point.flange_mm[:2]].append((*point.point_mm[:2], point.before_mm, point.after_mm))
    columns = [np.array(rows) for rows in above.values()]
    at_mm = [(float(x), float(y)) for x, y in (column[:, :2].mean(axis=0) for column in columns)]
    rms_mm = np.array([np.sqrt(np.mean(column[:, 2:] ** 2, axis=0)) for column in columns])
    return [
        (word, float(values.max()), bubble_map(at_mm, values.tolist(), float(rms_mm.max())))
        for word, values in zip(("arm.before", "arm.after"), rms_mm.T, strict=True)
    ]


def verification_report(run: "RunRecord", context: ReportContext) -> str:
    """The report of a finished verification: Tab. 1 of Song et al., points seen from several positions."""
    return render("verification", run.id, context, verified=_verified(run), **_drift(context.drift))


def _verified(run: "RunRecord") -> dict[str, Any]:
    """Its result, with the points of the cross in place of their ids, and where each position has them."""
    assert run.result is not None
    found: dict[str, Any] = run.result["verification"]
    by_id = {point["id"]: point for point in found["points"]}
    places_of = f"{found.get('frame', 'base')}_mm"  # runs stored before the camera could stand beside the robot
    cross = [{**by_id[point], "places": by_id[point][places_of]} for point in found["cross"] if point in by_id]
    return {"expected_point_mm": None, **found, "cross": cross, "run_id": run.id, "at": run.updated_at}


def drift_report(drift: "DriftChart", context: ReportContext) -> str:
    """The control chart of the active calibration."""
    first, last = (drift.points[0].at, drift.points[-1].at) if drift.points else (DASH, DASH)
    about = {"calibration": drift.report.calibration_id or "", "last": last}
    number = text_of("drift.number", about, language_of(context.language))
    return render("drift", number, context, first=first, last=last, **_drift(drift))


def _drift(drift: "DriftChart | None") -> dict[str, Any]:
    """The control chart with its standing, its alarm and what may have changed; without points no chart."""
    if drift is None:
        return {"drift": None, "alarm": None, "chart": None, "standing": "off", "changes": []}
    points = [
        ChartPoint(point.at[:16].replace("T", " "), point.drift_mm, point.limit_mm, point.standing in ALARMING)
        for point in drift.points
    ]
    return {
        "drift": drift,
        "alarm": None if drift.report.alarm is None else as_sentence(drift.report.alarm),
        "chart": control_chart(points, "mm") if points else None,
        "standing": drift.report.standing,
        "changes": [_change(one) for one in drift.changes if one.chance >= MIN_SHOWN_CHANCE],
    }


def _change(change: DriftChangeDocument) -> tuple[str, dict[str, Any]]:
    """The word of what may have changed, and what fills it."""
    turned_deg = math.hypot(*change.turn_deg or ()) if change.axis is None else change.turned_deg
    amounts = {"axis": change.axis, "shift_mm": math.hypot(*change.shift_mm or ()), "turned_deg": turned_deg}
    return f"change.{change.cause}", {**amounts, "chance": change.chance}


def scan_report(
    scan: "ScanRecord",
    found: "RegistrationReportDocument",
    context: ReportContext,
    pictures: Sequence[Picture] = (),
    deviations: DeviationMap | None = None,
) -> str:
    """The report of a registered scan; `pictures`: the merged cloud from three sides."""
    bars = [Bar(str(view.index + 1), view.rms_mm) for view in found.views if view.rms_mm is not None]
    shares = [
        Bar("0" if abs(middle_mm) < 1e-9 else f"{middle_mm:+.2g}".replace("-", MINUS), 100 * share)
        for middle_mm, share in (
            () if deviations is None else zip(deviations.middles_mm, deviations.shares, strict=True)
        )
    ]
    return render(
        "scan", scan.id, context, scan=scan, found=found, pictures=pictures, deviations=deviations,
        bars=bar_chart(bars, "mm") if bars else None,
        shares=bar_chart(shares, "%") if shares else None,
    )  # fmt: skip


def acceptance_report(record: "DocumentRecord", found: "AcceptanceDocument", context: ReportContext) -> str:
    """The report of a scanner's verification. It has no limits: they are those of its data sheet or of the plant."""
    bars = [Bar(str(one.view + 1), max((ball.form_mm for ball in one.balls), default=0.0)) for one in found.positions]
    chart = bar_chart(bars, "mm") if bars else None
    return render("acceptance", record.id, context, record=record, found=found, bars=chart)


TURN, SHIFT = slice(0, 3), slice(3, 6)


Part = tuple[str, float | None, float | None]
"""A part of u by its word: u in mm with the sign of its variance, and its share in percent; None: not known."""


@dataclass(frozen=True)
class PointBudget:
    """The parts of u at a point and u itself; `registered_mm`: U there in a cloud."""

    point: str
    parts: tuple[Part, ...]
    combined_mm: float
    registered_mm: float


def budget_at_worst(sure: UncertaintyDocument | None) -> PointBudget | None:
    """The parts of u at the worst point; None in a document without a covariance."""
    covariance = None if sure is None else sure.matrix()
    worst = None if sure is None else sure.worst_point
    if sure is None or covariance is None or worst is None:
        return None
    scale = sure.arm_scale
    by_scale = None if scale is None else scale_variance_mm2(scale.scale(), np.array(worst.camera_mm))
    variances = {**point_variances(covariance, worst), "budget.scale-part": by_scale}
    total = sum(variance for variance in variances.values() if variance is not None)
    return PointBudget(
        worst.name,
        tuple(
            (word, None, None)
            if variance is None
            else (
                word,
                math.copysign(math.sqrt(abs(variance)), variance),
                100 * variance / total if total > 0 else None,
            )
            for word, variance in variances.items()
        ),
        math.sqrt(max(total, 0.0)),
        sure.registered_expanded_mm(worst),
    )


def point_variances(covariance: Array, point: PointUncertaintyDocument) -> dict[str, float]:
    """Variances in mm², over all three axes, of the point by the parts of `covariance` (6, 6) of X @ exp(v)."""
    rows = point_rows(np.array([point.camera_mm]))[0]

    def variance(kept: Array) -> float:
        return float(np.trace(rows @ kept @ rows.T))

    turn, shift = np.zeros((6, 6)), np.zeros((6, 6))
    turn[TURN, TURN], shift[SHIFT, SHIFT] = covariance[TURN, TURN], covariance[SHIFT, SHIFT]
    return {
        "budget.turn": variance(turn),
        "budget.shift": variance(shift),
        "budget.both": variance(covariance - turn - shift),
    }


def scale_percent(document: CalibrationDocument) -> float | None:
    """By how much lengths of the arm and of the scanner may differ, percent."""
    scale = document.uncertainty and document.uncertainty.arm_scale
    return 100 * math.hypot(scale.sigma, scale.log) if scale else None
