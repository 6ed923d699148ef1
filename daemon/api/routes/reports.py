"""Reports as self-contained HTML or as PDF: of a calibration, a verification, the control chart, a scan, a scanner."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from fastapi import Depends, Query, Request, Response
from numpy.typing import NDArray

from calibration.documents.calibration import CalibrationDocument
from calibration.sentences.sentence import LANGUAGES, LanguageTag, Sentence
from calibration.targets import Target
from daemon.api.dependencies import App, Identifier, WidthQuery, WithCamera, api_router, in_content
from daemon.api.negotiation import choose_picture_type, media_ranges, weighted_values
from daemon.api.routes.cell import PICTURES
from daemon.api.routes.scans import calibration_of_scan
from daemon.application import Application
from daemon.errors import NotFound
from daemon.reports.context import DeviationMap, Picture, ReportContext, session_sha256, shown_field
from daemon.reports.pages import policy_of
from daemon.reports.pdf import Attached, ReportTooSlow, write_pdf
from daemon.reports.reports import acceptance_report, calibration_report, drift_report, scan_report, verification_report
from daemon.scans.scanner_acceptance import AcceptanceDocument
from daemon.sessions.pictures import PictureType, encode_picture
from daemon.sessions.session_files import find_grey
from registration.fusion.merging import Merge
from registration.fusion.view_surface import SURFACE

router = api_router()

Route = TypeVar("Route", bound=Callable[..., Any])

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


@dataclass(frozen=True)
class Reader:
    """Who asks for a report, in which language."""

    app: Application
    request: Request
    language: LanguageTag

    def context(self, **known: Any) -> ReportContext:
        """The report's context, with what is `known` beyond settings and language."""
        settings = self.app.settings
        return ReportContext(self.language, settings.report, settings.robot.model_name, settings.target, **known)

    async def answer(self, report: Callable[[], str], form: str | None, attached: Attached | None = None) -> Response:
        """HTML, or PDF where it is asked for. Both are written in a worker, the PDF one at a time a thread.

        Raises ReportExtraMissing, WorkersBusy, ReportTooSlow.
        """
        html, policy = await self.app.service_workers.run(_with_policy, report)
        headers = {"Content-Language": self.language, "Vary": "Accept, Accept-Language"}
        weights = dict(media_ranges(self.request))
        prefers_pdf = weights.get(PDF, 0.0) > weights.get(HTML, 0.0)
        if form == "html" or not (form or prefers_pdf):
            headers["Content-Security-Policy"] = policy
            return Response(html, media_type=f"{HTML}; charset=utf-8", headers=headers)
        try:
            async with asyncio.timeout(MAX_PDF_S):
                content = await self.app.service_workers.run_if_free(write_pdf, html, attached)
        except TimeoutError:
            raise ReportTooSlow(MAX_PDF_S) from None
        return Response(content, media_type=PDF, headers=headers)


async def _reader(
    app: App,
    request: Request,
    language: Annotated[
        LanguageTag | None, Query(description="without it, as Accept-Language prefers; else en")
    ] = None,
) -> Reader:
    """In the language asked for, else as Accept-Language prefers, else English."""
    known = [(weight, tag) for name, weight in weighted_values(request, "accept-language")
             for tag in LANGUAGES if name.partition("-")[0] == tag and weight > 0]  # fmt: skip
    return Reader(app, request, language or max(known, key=lambda one: one[0], default=(1.0, LANGUAGES[0]))[1])


WithReader = Annotated[Reader, Depends(_reader)]


def _report(path: str, tag: str, *refusals: int) -> Callable[[Route], Route]:
    """The route of a report: one file as HTML or PDF, or one of these refusals."""
    about = "The report, one file without a script"
    return router.get(path, tags=[tag], **in_content(about, {HTML: {}, PDF: {}}, *refusals))


@_report("/calibrations/{calibration_id}/report", "calibrations", 404, 406, 409, 429)
async def report_calibration(app: App, calibration_id: Identifier, reader: WithReader, form: Form = None) -> Response:
    """The calibration report: identification, result with U (k = 2), views, budget, verification, traceability.

    As PDF (extra `report`) it is PDF/A-3 with calibration.json attached.
    """
    if calibration_id == "current":
        calibration_id = (await app.operations.calibrations.find("current")).id
    record = await app.store.calibration(calibration_id)
    document = record.document
    content = document.model_dump_json().encode()
    context = reader.context(
        run_id=record.run_id, issued_at=app.clock.timestamp(), document_sha256=sha256(content).hexdigest()
    )
    context = await _with_history(app, context, document.id)
    if record.run_id is not None:
        folder = app.store.session_folder(record.run_id, record.camera)
        seen_by = record.camera  # the settings may name it no more
        settings = app.settings.of_camera(seen_by) if seen_by in app.settings.camera_names else app.settings
        pictures, digest = await app.service_workers.run(_session, settings.target, folder, document)
        context = replace(context, pictures=pictures, session_sha256=digest)
    errors = await app.store.arm(document.id)
    if errors is not None:
        field = await app.service_workers.run(shown_field, document, errors)
        context = replace(context, arm=errors, arm_field=field)
    report = partial(calibration_report, document, context)
    attached = Attached("calibration.json", content, "the calibration")
    return await reader.answer(report, form, attached)


async def _with_history(app: Application, context: ReportContext, calibration_id: str) -> ReportContext:
    """The context with when and by whom it was applied, its chart and the last verification when it is active."""
    history = await app.store.history(MAX_HISTORY)
    applied = next((entry for entry in history if entry.calibration_id == calibration_id), None)
    if applied is None:
        return context
    context = replace(context, applied_at=applied.applied_at, applied_by=applied.applied_by)
    in_force = next(entry for entry in history if entry.camera == applied.camera)
    if in_force.calibration_id != calibration_id or applied.camera not in app.settings.camera_names:
        return context
    chart = await app.camera(applied.camera).drift.refresh()
    if not chart.points:
        return context
    return replace(context, drift=chart, verification=await app.store.run(chart.points[-1].run_id))


def _session(target: Target, folder: Path, document: CalibrationDocument) -> tuple[tuple[Picture, ...], str | None]:
    from daemon.reports.pictures import view_pictures  # loads detection, which the daemon needs for runs only

    pictures = view_pictures(document.views, target, lambda name: find_grey(folder / name))
    return pictures, session_sha256(folder)


@_report("/runs/{run_id}/report", "runs", 404, 406, 429)
async def report_verification(app: App, run_id: Identifier, reader: WithReader, form: Form = None) -> Response:
    """The report of a finished verification. That of a calibration run is GET /calibrations/{id}/report."""
    run = await app.supervisor.run(run_id)
    if run.kind != "verify" or run.result is None or "verification" not in run.result:
        found = run.result.get("calibration_id") if run.result else None
        fix = Sentence("see-calibration-report", calibration=found) if found else Sentence("wait-or-ask-quick-check")
        raise NotFound(Sentence("no-quick-check-of-run", run=run_id), fix)
    context = reader.context(run_id=run.id, issued_at=app.clock.timestamp())
    context = await _with_history(app, context, run.result["verification"]["calibration_id"])
    return await reader.answer(partial(verification_report, run, context), form)


@_report("/drift/report", "calibrate", 404, 406, 429, 507)
async def report_drift(camera: WithCamera, reader: WithReader, form: Form = None) -> Response:
    """The control chart of the active calibration, as a report."""
    chart = await camera.drift.refresh()
    if not chart.report.calibration_id:
        raise NotFound(Sentence("no-active-calibration"), Sentence("apply-and-check"))
    report = partial(drift_report, chart, reader.context())
    return await reader.answer(report, form)


@_report("/scans/{scan_id}/report.html", "scans", 404, 406, 409, 413, 429, 500, 507)
async def report_scan(app: App, scan_id: Identifier, reader: WithReader, form: Form = None) -> Response:
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
    scan, context = await app.store.scan(scan_id), reader.context()
    report = partial(scan_report, scan, found, context, pictures, deviations)
    return await reader.answer(report, form)


@router.get("/scans/{scan_id}/picture", tags=["scans"], **in_content(*PICTURES, 404, 406, 409, 413, 415, 429, 500, 507))
async def picture_scan(
    request: Request, app: App, scan_id: Identifier, side: Side = "front", width: WidthQuery = None
) -> Response:
    """The merged cloud from one side, the nearer the lighter, as Accept prefers.

    480 pixels wide without `width`, 960 at the most; by the active calibration, each time anew.
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


def _cloud_pictures(file: Path) -> tuple[Picture, ...]:
    """Of a file of float32 x, y, z; an even choice of its points."""
    from daemon.reports.pictures import cloud_pictures

    return cloud_pictures(_points_of(file))


def _draw(file: Path, side: str, media_type: PictureType, px: int) -> bytes:
    from daemon.reports.pictures import draw_cloud

    return encode_picture(draw_cloud(_points_of(file), side, px)[0], media_type, None)


def _points_of(file: Path) -> NDArray[np.float32]:
    """An even choice of its points (n, 3)."""
    if file.stat().st_size < 12:
        return np.empty((0, 3), np.float32)
    points = np.memmap(file, np.float32, "r").reshape(-1, 3)
    return np.array(points[:: max(1, len(points) // MAX_PICTURED_POINTS)])


def _deviation_map(surfaces: list[bytes]) -> DeviationMap | None:
    from daemon.reports.pictures import deviation_map

    return deviation_map(surfaces, SURFACE)


@_report("/acceptances/{acceptance_id}/report", "calibrate", 404, 406, 429)
async def report_acceptance(app: App, acceptance_id: Identifier, reader: WithReader, form: Form = None) -> Response:
    """The report of a verification of the scanner with a sphere or a ball bar."""
    record = await app.store.acceptances.get(acceptance_id)
    found = record.parsed(AcceptanceDocument)
    report = partial(acceptance_report, record, found, reader.context())
    return await reader.answer(report, form)


def _with_policy(report: Callable[[], str]) -> tuple[str, str]:
    html = report()
    return html, policy_of(html)
