"""Reports as self-contained HTML or as PDF: of a calibration, a verification, the control chart, a scan, a scanner."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from numpy.typing import NDArray

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.reports.acceptance_report import (
    MeasuredBall,
    MeasuredPosition,
    ScannerVerification,
    acceptance_report,
)
from calibration.documents.reports.blocks import policy_of
from calibration.documents.reports.calibration_report import calibration_report
from calibration.documents.reports.context import Drift, DriftedPoint, Picture, ReportContext
from calibration.documents.reports.scan_report import DeviationMap, Scan, ScannedView, scan_report
from calibration.documents.reports.verification_report import drift_report, verification_report
from calibration.targets import Target
from daemon.api.dependencies import App, Identifier, WidthQuery, WithCamera
from daemon.api.negotiation import choose_picture_type, media_ranges
from daemon.api.plain_text import MIN_SHOWN_CHANCE, change_text
from daemon.api.problems import problem_responses
from daemon.api.routes.cell import PICTURES
from daemon.api.routes.scans import calibration_of_scan
from daemon.api.schemas.acceptances import StoredAcceptance
from daemon.api.schemas.drift import DriftChangeDocument
from daemon.application import Application
from daemon.drift.chart import DriftChart
from daemon.errors import NotFound
from daemon.sessions.pictures import PictureType, encode_picture
from daemon.sessions.session_files import find_grey
from daemon.tools.reports.arm_errors import arm_in_report
from daemon.tools.reports.context import context_of, session_sha256, verified_points
from daemon.tools.reports.errors import ReportTooSlow
from daemon.tools.reports.pdf import Attached, write_pdf
from registration.documents import RegistrationReportDocument
from registration.fusion.merging import Merge
from registration.fusion.view_surface import SURFACE

router = APIRouter()

HTML, PDF = "text/html", "application/pdf"
MAX_PDF_S = 20.0
MAX_PICTURED_POINTS = 400_000
PICTURE_VOXEL_MM = 2.0
MAP_VOXEL_MM = 4.0
MAX_MAPPED_VIEWS = 24
OCTETS = ".bin"
MAX_HISTORY = 500

Side = Annotated[Literal["above", "front", "side"], Query(alias="from", description="where it is looked at from")]

Form = Annotated[
    Literal["html", "pdf"] | None, Query(alias="format", description="html or pdf; without it, as Accept prefers")
]
REPORT: dict[int | str, dict[str, Any]] = {
    200: {"description": "The report, one file without a script", "content": {HTML: {}, PDF: {}}}
}


@router.get(
    "/calibrations/{calibration_id}/report",
    tags=["calibrations"],
    response_class=Response,
    responses={**REPORT, **problem_responses(404, 406, 409, 429)},
)
async def report_calibration(request: Request, app: App, calibration_id: Identifier, form: Form = None) -> Response:
    """The calibration report: identification, result with U (k = 2), views, budget, verification, traceability.

    As PDF (extra `report`) it is PDF/A-3 with calibration.json attached.
    """
    if calibration_id == "current":
        document = await app.operations.calibrations.find("current")
        record = await app.store.calibration(document.id)
    else:
        record = await app.store.calibration(calibration_id)
        document = record.document
    content = document.model_dump_json().encode()
    context = replace(
        context_of(app.settings),
        run_id=record.run_id,
        issued_at=app.clock.timestamp(),
        document_sha256=sha256(content).hexdigest(),
    )
    context = await _with_history(app, context, document.id)
    if record.run_id is not None:
        folder = app.store.session_folder(record.run_id, record.camera)
        pictures, digest = await app.service_workers.run(_session, _target_of(app, record.camera), folder, document)
        context = replace(context, pictures=pictures, session_sha256=digest)
    errors = await app.store.arm(document.id)
    if errors is not None:
        context = replace(context, arm=await app.service_workers.run(arm_in_report, document, errors))
    report = partial(calibration_report, document, context)
    return await _answer(request, app, report, form, Attached("calibration.json", content, "the calibration"))


async def _with_history(app: Application, context: ReportContext, calibration_id: str) -> ReportContext:
    """The context with when and by whom it was applied, its chart and the last verification when it is in force."""
    history = await app.store.history(MAX_HISTORY)
    applied = next((entry for entry in history if entry.calibration_id == calibration_id), None)
    if applied is None:
        return context
    context = replace(context, applied_at=applied.applied_at, applied_by=applied.applied_by)
    in_force = next(entry for entry in history if entry.camera == applied.camera)
    if in_force.calibration_id != calibration_id or applied.camera not in app.settings.camera_names:
        return context
    chart = _drift_of(await app.camera(applied.camera).drift.refresh())
    if chart.points:
        last = await app.store.run(chart.points[-1].run_id)
        context = replace(context, drift=chart, verification=verified_points(last))
    return context


def _drift_of(chart: DriftChart) -> Drift:
    """The control chart."""
    points = tuple(
        DriftedPoint(point.run_id, point.at, point.standing.value, point.drift_mm, point.limit_mm, point.scatter_mm)
        for point in chart.points
    )
    standing = chart.report.standing.value if chart.report.standing else "off"
    changes = [DriftChangeDocument.of(one) for one in chart.changes if one.chance >= MIN_SHOWN_CHANCE]
    words = tuple(change_text(change) for change in changes)
    return Drift(chart.report.calibration_id, standing, points, chart.report.alarm, words)


def _target_of(app: Application, camera: str) -> Target:
    """What this camera looks at; [target] for a camera that the settings name no more."""
    known = camera in app.settings.camera_names
    return (app.settings.of_camera(camera) if known else app.settings).target.target()


def _session(target: Target, folder: Path, document: CalibrationDocument) -> tuple[tuple[Picture, ...], str | None]:
    from daemon.tools.reports.pictures import view_pictures  # loads detection, which the daemon needs for runs only

    pictures = view_pictures(document.views, target, lambda name: find_grey(folder / name))
    return pictures, session_sha256(folder)


@router.get(
    "/runs/{run_id}/report",
    tags=["runs"],
    response_class=Response,
    responses={**REPORT, **problem_responses(404, 406, 429)},
)
async def report_verification(request: Request, app: App, run_id: Identifier, form: Form = None) -> Response:
    """The report of a finished verification. That of a calibration run is GET /calibrations/{id}/report."""
    run = await app.supervisor.run(run_id)
    if run.kind != "verify" or run.result is None or "verification" not in run.result:
        found = run.result.get("calibration_id") if run.result else None
        fix = f"GET /calibrations/{found}/report" if found else "wait for its end, or ask for a verification"
        raise NotFound(f"run {run_id} has no result of a verification", fix)
    verified = verified_points(run)
    context = replace(context_of(app.settings), run_id=run.id, issued_at=app.clock.timestamp())
    context = replace(await _with_history(app, context, verified.calibration_id), verification=None)
    return await _answer(request, app, partial(verification_report, verified, context), form)


@router.get(
    "/drift/report",
    tags=["calibrate"],
    response_class=Response,
    responses={**REPORT, **problem_responses(404, 406, 429, 507)},
)
async def report_drift(request: Request, app: App, camera: WithCamera, form: Form = None) -> Response:
    """The control chart of the calibration in force, as a report."""
    chart = _drift_of(await camera.drift.refresh())
    if not chart.calibration_id:
        raise NotFound("no calibration is in force", "apply one, and verify it")
    return await _answer(request, app, partial(drift_report, chart, context_of(app.settings)), form)


@router.get(
    "/scans/{scan_id}/report.html",
    tags=["scans"],
    response_class=Response,
    responses={**REPORT, **problem_responses(404, 406, 409, 413, 429, 500, 507)},
)
async def report_scan(request: Request, app: App, scan_id: Identifier, form: Form = None) -> Response:
    """The report of a scan: its merged cloud from three sides, how its views agree, and the map of their deviations."""
    used = await calibration_of_scan(app, scan_id, "current")
    found = await (await app.scans.start_registration(scan_id, used, refine=False))
    clouds = await app.scans.clouds(scan_id, used, None)
    merged = await app.scans.merge_views(scan_id, clouds, used.document.id, OCTETS, Merge(PICTURE_VOXEL_MM))
    try:
        pictures = await app.service_workers.run(_cloud_pictures, merged)
    finally:
        await app.service_workers.run(merged.unlink, missing_ok=True)
    surfaces = [
        await app.scans.view_surface(scan_id, clouds, index, MAP_VOXEL_MM)
        for index in range(min(len(clouds), MAX_MAPPED_VIEWS))
    ]
    deviations = await app.service_workers.run(_deviation_map, surfaces)
    record = await app.store.scan(scan_id)
    shown = replace(_scan_of(found, pictures, scan_id, record.name, record.created_at), deviations=deviations)
    return await _answer(request, app, partial(scan_report, shown, context_of(app.settings)), form)


@router.get(
    "/scans/{scan_id}/picture",
    tags=["scans"],
    response_class=Response,
    responses={200: PICTURES, **problem_responses(404, 406, 409, 413, 415, 429, 500, 507)},
)
async def picture_scan(
    request: Request, app: App, scan_id: Identifier, side: Side = "front", width: WidthQuery = None
) -> Response:
    """The merged cloud from one side, the nearer the lighter, as Accept prefers.

    480 pixels wide without `width`, 960 at the most; by the calibration in force, each time anew.
    """
    media_type = choose_picture_type(request)
    used = await calibration_of_scan(app, scan_id, "current")
    clouds = await app.scans.clouds(scan_id, used, None)
    merge = Merge(PICTURE_VOXEL_MM, most=MAX_PICTURED_POINTS)
    merged = await app.scans.merge_views(scan_id, clouds, used.document.id, OCTETS, merge)
    try:
        content = await app.service_workers.run(_draw, merged, side, media_type, min(width or 480, 960))
    finally:
        await app.service_workers.run(merged.unlink, missing_ok=True)
    return Response(content, media_type=media_type, headers={"Vary": "Accept"})


def _scan_of(
    found: RegistrationReportDocument, pictures: tuple[Picture, ...], scan_id: str, name: str, at: str
) -> Scan:
    views = tuple(
        ScannedView(
            view.index,
            view.points,
            view.overlap,
            view.rms_mm,
            float(np.linalg.norm(view.correction.translation_mm)) if view.correction else None,
        )
        for view in found.views
    )
    return Scan(
        scan_id, name, at, found.calibration_id, found.points, views, found.rms_mm.before, found.rms_mm.after,
        found.verdict.accepted, found.verdict.findings, pictures,
    )  # fmt: skip


def _cloud_pictures(file: Path) -> tuple[Picture, ...]:
    """Of a file of float32 x, y, z; an even choice of its points."""
    from daemon.tools.reports.pictures import cloud_pictures

    return cloud_pictures(_points_of(file))


def _draw(file: Path, side: str, media_type: PictureType, px: int) -> bytes:
    from daemon.tools.reports.pictures import draw_cloud

    return encode_picture(draw_cloud(_points_of(file), side, px)[0], media_type, None)


def _points_of(file: Path) -> NDArray[np.float32]:
    """An even choice of its points (n, 3)."""
    if file.stat().st_size < 12:
        return np.empty((0, 3), np.float32)
    points = np.memmap(file, np.float32, "r").reshape(-1, 3)
    return np.array(points[:: max(1, len(points) // MAX_PICTURED_POINTS)])


def _deviation_map(surfaces: list[bytes]) -> DeviationMap | None:
    from daemon.tools.reports.deviation_map import deviation_map

    return deviation_map(surfaces, SURFACE)


@router.get(
    "/acceptances/{acceptance_id}/report",
    tags=["calibrate"],
    response_class=Response,
    responses={**REPORT, **problem_responses(404, 406, 429)},
)
async def report_acceptance(request: Request, app: App, acceptance_id: Identifier, form: Form = None) -> Response:
    """The report of a verification of the scanner with a sphere or a ball bar."""
    stored = StoredAcceptance.of_record(await app.store.acceptances.get(acceptance_id))
    report = partial(acceptance_report, _verification_of(stored), context_of(app.settings))
    return await _answer(request, app, report, form)


def _verification_of(stored: StoredAcceptance) -> ScannerVerification:
    found = stored.acceptance
    return ScannerVerification(
        stored.id, stored.created_at, stored.created_by, found.scan_id, found.based_on, found.artefact.radius_mm,
        found.artefact.spacing_mm, found.probing_form_mm, found.probing_size_mm, found.sphere_spacing_mm,
        tuple(
            MeasuredPosition(
                position.view,
                tuple(MeasuredBall(ball.centre_mm, ball.form_mm, ball.size_mm, ball.points) for ball in position.balls),
                position.spacing_error_mm,
            )
            for position in found.positions
        ),
    )  # fmt: skip


async def _answer(
    request: Request, app: Application, report: Callable[[], str], form: str | None, attached: Attached | None = None
) -> Response:
    """HTML, or PDF where it is asked for. Both are written in a worker, the PDF one at a time a thread.

    Raises ReportExtraMissing, WorkersBusy, ReportTooSlow.
    """
    html, policy = await app.service_workers.run(_with_policy, report)
    if (form or _preferred(request)) == "html":
        headers = {"Content-Security-Policy": policy, "Vary": "Accept"}
        return Response(html, media_type=f"{HTML}; charset=utf-8", headers=headers)
    try:
        async with asyncio.timeout(MAX_PDF_S):
            content = await app.service_workers.run_if_free(write_pdf, html, attached)
    except TimeoutError:
        raise ReportTooSlow(MAX_PDF_S) from None
    return Response(content, media_type=PDF, headers={"Vary": "Accept"})


def _with_policy(report: Callable[[], str]) -> tuple[str, str]:
    html = report()
    return html, policy_of(html)


def _preferred(request: Request) -> str:
    """pdf when Accept gives it a higher weight than HTML."""
    weights = dict(media_ranges(request))
    return "pdf" if weights.get(PDF, 0.0) > weights.get(HTML, 0.0) else "html"
