"""The calibration report: contents as ISO/IEC 17025:2017, 7.8.2 and 7.8.4; U = k u with k stated (JCGM 100, 7.2)."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from calibration.documents.calibration import (
    TRANSFORM_NAMES,
    AccuracyDocument,
    CalibrationDocument,
    PointUncertaintyDocument,
    ViewResultDocument,
)
from calibration.documents.exports.notation import angles_xyz
from calibration.documents.pose import PoseDocument
from calibration.documents.reports.arm_block import arm_block
from calibration.documents.reports.blocks import (
    blank,
    facts,
    findings,
    hashes,
    identification,
    known,
    page,
    picture,
    signatures,
    table,
    verdict,
)
from calibration.documents.reports.charts import Bar, bar_chart, limit_scale
from calibration.documents.reports.context import ReportContext
from calibration.documents.reports.markup import Markup, join, tag
from calibration.documents.reports.numbers import DASH, number, places, significant
from calibration.documents.reports.verification_report import drift_block, verified_block
from calibration.likelihood.mapped_points import point_rows, scale_variance_mm2
from calibration.solution import worst_of
from calibration.transforms import Array

TURN, SHIFT = slice(0, 3), slice(3, 6)


def budget_at_worst(document: CalibrationDocument) -> Markup | None:
    """The parts of u at the worst point; None in a document without a covariance."""
    sure = document.uncertainty
    covariance = None if sure is None else sure.matrix()
    if sure is None or covariance is None or not sure.points:
        return None
    worst, scale = worst_of(sure.points), sure.arm_scale
    by_scale = None if scale is None else scale_variance_mm2(scale.scale(), np.array(worst.camera_mm))
    rows = [*point_variances(covariance, worst), ("scale between scanner and arm (B)", by_scale)]
    total = sum(variance for _, variance in rows if variance is not None)
    shown = [(name, _root(variance), _share(variance, total)) for name, variance in rows]
    shown.append(("combined", significant(math.sqrt(max(total, 0.0))), "100 %"))
    registered = significant(sure.registered_expanded_mm(worst))
    about = (
        f"At {worst.name}, the worst of the points that matter; shares are of the variance. A negative one: turn and"
        " shift of the camera err against each other there. Lens and target are in both. U above is in the arm's"
        f" millimetres; of a registered point, in the scanner's, it is {registered} mm."
    )
    return join(table(("part", "u / mm", "share"), shown), tag("p", about, class_="small"))


def point_variances(covariance: Array, point: PointUncertaintyDocument) -> list[tuple[str, float]]:
    """Variances in mm², over all three axes, of the point by the parts of `covariance` (6, 6) of X @ exp(v)."""
    rows = point_rows(np.array([point.camera_mm]))[0]

    def variance(kept: Array) -> float:
        return float(np.trace(rows @ kept @ rows.T))

    turn, shift = np.zeros((6, 6)), np.zeros((6, 6))
    turn[TURN, TURN], shift[SHIFT, SHIFT] = covariance[TURN, TURN], covariance[SHIFT, SHIFT]
    return [
        ("turn of the camera (A)", variance(turn)),
        ("shift of the camera (A)", variance(shift)),
        ("both together (A)", variance(covariance - turn - shift)),
    ]


def _root(variance: float | None) -> str:
    return DASH if variance is None else significant(math.copysign(math.sqrt(abs(variance)), variance))


def _share(variance: float | None, total: float) -> str:
    return DASH if variance is None or total <= 0 else f"{number(100 * variance / total, 0)} %"


SETUP_WORDS = {
    "eye-in-hand": ("camera on the robot's flange", "flange frame (tool0)"),
    "eye-to-hand": ("camera beside the robot", "robot's base frame"),
}
K = "k\u00a0=\u00a02"


def calibration_report(document: CalibrationDocument, context: ReportContext) -> str:
    """The report as HTML."""
    where, frame = SETUP_WORDS[document.setup]
    sections: list[tuple[str, Any]] = [
        ("Identification", _identification(document, context)),
        ("Measurand and method", _method(document, frame)),
        ("Result", _result(document)),
        ("Views", _views(document, context)),
        ("Uncertainty budget", _budget(document, context)),
        *([("The arm as built", arm_block(context.arm))] if context.arm else []),
        ("Verification", _verification(context)),
        ("Traceability, conditions, validity", _traceability(context)),
        ("Findings", findings(document.verdict.findings)),
        ("Integrity and release", join(hashes(context), signatures(context))),
    ]
    return page("Calibration report", where, document.id, [_verdict(document)], sections)


def _verdict(document: CalibrationDocument) -> Markup:
    x = getattr(document, TRANSFORM_NAMES[document.setup][0])
    if x is None:
        return verdict(False, "Refused.", "The motions do not determine the camera's pose; there is no result.")
    accuracy = document.accuracy
    word = "Accepted." if document.verdict.accepted else "Not accepted."
    if accuracy.expanded_mm is None:
        u = document.uncertainty.point_mm if document.uncertainty else None
        return verdict(document.verdict.accepted, word, f"A mapped point: standard uncertainty {significant(u)} mm.")
    name = f" at the worst of the points that matter ({accuracy.worst_point})"
    text = f"A point mapped into the base: U = {significant(accuracy.expanded_mm)} mm ({K}, 95 % or more){name}."
    box = join(verdict(document.verdict.accepted, word, text), _beside(accuracy))
    if accuracy.tolerance_mm is None:
        return box
    stated = "" if accuracy.tolerance_stated else ", which was not stated by you"
    rule = tag("p", "Decision rule: simple acceptance (ISO/IEC 17025, 7.8.6; guard band zero): U is compared with the"
                    f" tolerance of {accuracy.tolerance_mm:g} mm{stated}.", class_="small")  # fmt: skip
    return join(box, limit_scale(accuracy.expanded_mm, accuracy.tolerance_mm, "mm", "U beside the tolerance"), rule)


def _beside(accuracy: AccuracyDocument) -> Markup | None:
    """U as it was expected, and that of the calibration before."""
    known = (
        ("expected for these views before the run", accuracy.expected_mm),
        ("of the calibration in force before", accuracy.before_mm),
    )
    parts = [f"U {words}: {significant(value_mm)} mm" for words, value_mm in known if value_mm is not None]
    parts += [] if accuracy.why is None else [accuracy.why.message]
    return tag("p", "; ".join(parts) + ".", class_="small") if parts else None


def _identification(document: CalibrationDocument, context: ReportContext) -> Markup:
    camera = ""
    if document.camera is not None:
        width, height = document.camera.image_size
        source = "estimated with this calibration" if document.camera.source == "estimated" else "given"
        camera = f", {width} \u00d7 {height} px, intrinsics {source}"
    made: list[Any] = [document.created_at, f", {document.software}"]
    made += [f", run {context.run_id}"] if context.run_id else []
    if context.applied_at:
        made.append(f"; in force since {context.applied_at}, by {context.applied_by}")
    return identification(context, camera, join(*made))


def _method(document: CalibrationDocument, frame: str) -> Markup:
    x = TRANSFORM_NAMES[document.setup][0]
    seen = document.observability
    method = (
        "Maximum likelihood over the camera's pose, the target's pose and a correction of each robot pose; noise levels"
        " from the same data by restricted maximum likelihood"
        if document.method == "auto"
        else f"Closed form: {document.method}"
    )
    return tag(
        "p",
        f"The pose of the camera's optical frame (x right, y down, z ahead) in the {frame}, {x}, and the position in"
        f" the robot's base of a point that is mapped by it. {method}. {seen.views_used} of {len(document.views)} views"
        f" are in use, with rotations up to {seen.max_rotation_deg:.0f}\u00b0; the least determined direction is"
        f" {seen.weakest_direction}.",
    )


def _result(document: CalibrationDocument) -> Markup:
    names = TRANSFORM_NAMES[document.setup]
    x: PoseDocument | None = getattr(document, names[0])
    if x is None:
        return tag("p", "None: the motions do not determine it.")
    sure = document.uncertainty
    u_mm = [2 * u for u in sure.translation_mm] if sure else [None] * 3
    u_deg = [2 * u for u in sure.rotation_deg] if sure else [None] * 3
    rotation = x.transform()[:3, :3]
    angles = np.degrees(angles_xyz(rotation))
    turn = max((u for u in u_deg if u is not None), default=None)
    axes = ("x", "y", "z")
    first = table(
        ("", *axes),
        [
            ("translation / mm", *(number(v, places(u)) for v, u in zip(x.translation_mm, u_mm, strict=True))),
            (f"U ({K}) / mm, along the axes of the mount", *(significant(u) for u in u_mm)),
            (
                "Euler angles about x, y, z / \u00b0 (ABB's EulerZYX)",
                *(number(float(angle), places(turn)) for angle in angles),
            ),
            (f"U ({K}) of the rotation / \u00b0, about the camera's axes", *(significant(u) for u in u_deg)),
        ],
    )
    second = table(
        ("", "w (q1)", "x (q2)", "y (q3)", "z (q4)"), [("quaternion", *(number(q, 7) for q in x.quaternion_wxyz))]
    )
    return join(first, second, _points(document), _target_pose(document, names[1]))


def _points(document: CalibrationDocument) -> Markup | None:
    points = document.uncertainty.points if document.uncertainty else ()
    if not points:
        return None
    shown = sorted(points, key=lambda point: -point.expanded_mm)[:6]
    rows = [
        (point.name, point.frame, *(number(value, 1) for value in point.position_mm), significant(point.expanded_mm))
        for point in shown
    ]
    return table(("mapped point", "frame", "x / mm", "y / mm", "z / mm", f"U ({K}) / mm"), rows)


def _target_pose(document: CalibrationDocument, name: str) -> Markup | None:
    pose: PoseDocument | None = getattr(document, name)
    if pose is None:
        return None
    translation = ", ".join(number(value, 3) for value in pose.translation_mm)
    quaternion = ", ".join(number(value, 7) for value in pose.quaternion_wxyz)
    return tag(
        "p", f"The target then: {name} = ({translation}) mm, quaternion ({quaternion}), w first.", class_="small"
    )


def _views(document: CalibrationDocument, context: ReportContext) -> Markup:
    head: tuple[str, ...] = (
        "view",
        "picture",
        "status",
        "corners / px",
        "in base / mm",
        "robot by / mm",
        "robot by / \u00b0",
    )
    rows: list[tuple[Any, ...]] = [_view_row(view) for view in document.views]
    if any(view.camera_temperature_c is not None for view in document.views):
        head = (*head, "camera / \u00b0C")
        rows = [(*row, _temperature(view)) for row, view in zip(rows, document.views, strict=True)]
    bars = [
        Bar(str(view.index), view.base_error_mm, view.status == "rejected")
        for view in document.views
        if view.base_error_mm is not None
    ]
    chart = None
    if bars:
        chart = tag(
            "figure",
            bar_chart(bars, "mm", "error of each view in the base"),
            tag("figcaption", "Error of each view in the base, root mean square, with the robot's pose as reported;"
                              " dashed: not in use."),
        )  # fmt: skip
    pictures = tag("div", *(picture(each) for each in context.pictures), class_="columns") if context.pictures else None
    return join(chart, table(head, rows), _rejected(document), _hold_out(document), pictures)


def _view_row(view: ViewResultDocument) -> tuple[Any, ...]:
    moved, errors = view.robot_correction, (view.reprojection_px, view.base_error_mm)
    by = (DASH, DASH) if moved is None else (_length(moved.translation_mm), _length(moved.rotation_deg))
    return (view.index, view.image or DASH, view.status, *(significant(error) for error in errors), *by)


def _temperature(view: ViewResultDocument) -> str:
    return DASH if view.camera_temperature_c is None else f"{view.camera_temperature_c:.1f}"


def _length(vector: tuple[float, float, float]) -> str:
    return significant(math.hypot(*vector))


def _rejected(document: CalibrationDocument) -> Markup | None:
    reasons = [
        f"view {view.index}: {view.reason_detail.message if view.reason_detail else view.reason}"
        for view in document.views
        if view.status != "used" and view.reason
    ]
    return tag("p", "; ".join(reasons) + ".", class_="small") if reasons else None


def _hold_out(document: CalibrationDocument) -> Markup | None:
    held = document.hold_out
    if held is None:
        return None
    pixels = "" if held.reprojection_px is None else f" and {significant(held.reprojection_px)} px"
    text = f"Each view left out in turn and predicted by the others: {significant(held.base_error_mm)} mm in the base"
    return tag("p", f"{text}{pixels} (root mean square).", class_="small")


def _budget(document: CalibrationDocument, context: ReportContext) -> Markup:
    head = ("source", "standard uncertainty", "type", "how it is known")
    sources = join(table(head, [*_sources(document, context)], words=True), budget_at_worst(document))
    sure = document.uncertainty
    if sure is None:
        return sources
    combined = (
        f"Combined, of a mapped point (root mean square over the working volume): u = {significant(sure.point_mm)} mm."
        " The sources of type A are in it through the"
        " covariance of the solution; those of type B are not."
    )
    left = sure.leave_out
    beside = left and (
        f"By leaving out groups of views ({left.groups} groups, by {left.grouped_by}):"
        f" u = {significant(left.point_mm)} mm, {significant(left.ratio)} times the model's."
    )
    return join(sources, tag("p", combined), tag("p", beside, class_="small") if beside else None)


def _sources(document: CalibrationDocument, context: ReportContext) -> Iterator[tuple[Any, ...]]:
    noise, views = document.noise, f"estimated from {document.observability.views_used} views"
    for name, value, unit in (
        ("corners in the picture", noise.image_px, "px"),
        ("robot, position", noise.robot_translation_mm, "mm"),
        ("robot, orientation", noise.robot_rotation_deg, "\u00b0"),
    ):
        yield name, DASH if value is None else f"{significant(value)} {unit}", "A", views if value is not None else DASH
    scale = document.uncertainty and document.uncertainty.arm_scale
    share = DASH if not scale else f"{significant(100 * math.hypot(scale.sigma, scale.log))} %"
    yield "scale between scanner and arm", share, "B", "[calibration.known] of the settings, and the views"
    yield "temperature", blank("not recorded"), "B", "expansion of the target and the arm"


def _verification(context: ReportContext) -> Markup:
    parts = [
        verified_block(context.verification) if context.verification else None,
        drift_block(context.drift) if context.drift and context.drift.points else None,
    ]
    if not any(parts):
        return tag("p", "This calibration has not been verified yet.")
    return join(*parts)


def _traceability(context: ReportContext) -> Markup:
    temperature = None if context.temperature_c is None else f"{context.temperature_c:g} \u00b0C"
    return join(
        tag(
            "p",
            "Lengths trace to the pitch of the target and to nothing else; they are traceable when the target has a"
            " certificate, named above. Angles and times need no reference. The report holds for this arm, camera,"
            " mount and target as they were then; it ends when one of them is changed, or when the drift chart raises"
            " an alarm. It may be copied as a whole only.",
        ),
        facts([
            ("Temperature", known(temperature, "not recorded")),
            ("Issued", known(context.issued_at, "date")),
        ]),
    )  # fmt: skip
