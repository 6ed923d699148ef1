"""Routes of /scans: scans, their views, report and merged cloud."""

import asyncio
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from fastapi import Depends, Query, Request, Response
from pydantic import RootModel

from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.sentences.sentence import Sentence
from daemon.api.dependencies import (
    BOX_PATTERN,
    IN_DIGITS,
    IN_WHOLE_DIGITS,
    App,
    Before,
    Identifier,
    JsonBody,
    Limit,
    Wait,
    api_router,
    box_of,
    in_content,
    respond_rows,
)
from daemon.api.http_errors import CloudTooLarge
from daemon.api.middleware.disconnects import wait_for_run
from daemon.api.problems import problem_responses
from daemon.api.routes.register import Which
from daemon.api.schemas.scans import (
    CloudDocument,
    RegistrationState,
    ScanDocument,
    ScanList,
)
from daemon.api.streaming.cloud_request import (
    ANSWER_SUFFIXES,
    BINARY,
    JSON,
    TAKES_A_CLOUD,
    Beside,
    ForceQuery,
    PoseQuery,
    UnitQuery,
    arm_headers,
    choose_media_type,
    flange_pose_of,
    media_type_of,
)
from daemon.api.streaming.cloud_response import TemporaryFileResponse
from daemon.api.streaming.request_body import lend_body
from daemon.application import Application
from daemon.errors import NotFound
from daemon.model.records import ScanViewDocument
from daemon.model.requests import ScanRequest
from daemon.scans.scan_service import ReportTask
from daemon.store.listings import PageFilters
from registration.documents import RegistrationReportDocument
from registration.fusion.concatenation import PlacedCloud
from registration.fusion.merging import Merge, Outliers

NamePart = Annotated[str | None, Query(min_length=1, max_length=200, description="a part of the name")]

router = api_router(prefix="/scans", tags=["scans"])

MAX_JSON_POINTS = 10_000
"""Limit of points in JSON, which takes hundreds of times longer than octets."""

BODY_REFUSALS = (400, 403, 404, 409, 413, 415, 500, 502, 503, 504, 507)


@router.get("", response_model=ScanList)
async def scans(app: App, limit: Limit = 50, before: Before = None, name: NamePart = None) -> Response:
    """The newest first; with `name` those whose name has that in it, in either case."""
    filters = PageFilters({"name": name})
    found = await app.store.listings.scans(limit + 1, before, filters)
    return await respond_rows(app, found, limit, "/scans", lambda row: ScanDocument.of(row.scan, row.views), filters)


@router.post(
    "",
    response_model=ScanDocument,
    status_code=201,
    responses={202: {"description": "The arm is driven to fill it; follow run.links", "model": ScanDocument},
               **problem_responses(*BODY_REFUSALS)},
)  # fmt: skip
async def create(
    request: Request, app: App, body: Annotated[ScanRequest, Depends(JsonBody(ScanRequest))], wait: Wait = 0.0
) -> Response:
    """A new scan, for clouds you send; or with `capture` or `poses` one that the daemon's scanner fills."""
    scan, run = await app.operations.scan(body)
    if run is not None:
        run = await wait_for_run(request, app, run.id, wait)
    document = RootModel[ScanDocument](ScanDocument.of(scan, await app.store.scan_views(scan.id), run))
    status, headers = (201, {}) if run is None or run.is_over else (202, {"Retry-After": "1"})
    return Response(
        document.model_dump_json(), status, {"Location": f"/scans/{scan.id}", **headers}, media_type="application/json"
    )


@router.get("/{scan_id}", response_model=ScanDocument, responses=problem_responses(404))
async def scan(app: App, scan_id: Identifier) -> ScanDocument:
    """A scan and its views."""
    return ScanDocument.of(await app.store.scan(scan_id), await app.store.scan_views(scan_id))


@router.post(
    "/{scan_id}/views",
    response_model=ScanViewDocument,
    status_code=201,
    openapi_extra=TAKES_A_CLOUD,
    responses=problem_responses(*BODY_REFUSALS),
)
async def add_view(
    request: Request,
    app: App,
    scan_id: Identifier,
    beside: Beside,
    pose: PoseQuery = "now",
    unit: UnitQuery = "mm",
    force: ForceQuery = False,
) -> ScanViewDocument:
    """A cloud seen from `pose`; without a body the daemon's scanner takes one where the arm stands."""
    await app.store.scan(scan_id)
    if request.headers.get("content-length", "0") == "0" and "transfer-encoding" not in request.headers:
        return await app.operations.scan_here(scan_id)
    media_type, at = media_type_of(request), await flange_pose_of(app, pose, beside)
    lend_body(request.scope)
    return await app.scans.add_view(scan_id, request.stream(), media_type, unit, at, force=force)


PATIENCE = "seconds to wait for a registration before answering 202"
Patience = Annotated[float, Query(ge=0, le=3600, description=PATIENCE), IN_DIGITS]
Refine = Annotated[bool, Query(description="fit the views to each other, within the robot's noise")]
OneView = Annotated[int | None, Query(ge=0, description="only this view, from 0"), IN_WHOLE_DIGITS]
Voxel = Annotated[
    float | None, Query(gt=0, le=1e4, description="average the points of each cube of this edge"), IN_DIGITS
]
Normals = Annotated[bool, Query(description="fit normals where the clouds bring none; needs voxel_mm")]
Strays = Annotated[Outliers, Query(description="leave out averaged points that stand alone; needs voxel_mm")]
SurfaceView = Annotated[int, Query(ge=0, description="which view, from 0"), IN_WHOLE_DIGITS]
SurfaceVoxel = Annotated[float, Query(gt=0, le=1e4, description="edge of the cubes"), IN_DIGITS]
OCTETS = "application/octet-stream"
SURFACE = "float32 x, y, z, deviation, nx, ny, nz of each point, little-endian, mm"
BOX = "only points within this box of the base, mm: least x, y, z, largest x, y, z, with commas"
MOST = "double the edge of the cubes until there are no more points than these; needs voxel_mm"
MostPoints = Annotated[int | None, Query(ge=8, le=4_000_000, description=MOST), IN_WHOLE_DIGITS]
BoxQuery = Annotated[str | None, Query(pattern=BOX_PATTERN, max_length=100, description=BOX)]
STILL: dict[int | str, dict[str, Any]] = {
    202: {"description": "It is still in progress: ask again", "model": RegistrationState}
}

CONTENT: dict[str, Any] = {
    **dict.fromkeys(ANSWER_SUFFIXES, BINARY),
    JSON: {"schema": CloudDocument.model_json_schema()},
}


@router.get(
    "/{scan_id}/report",
    response_model=RegistrationReportDocument,
    responses={**STILL, **problem_responses(404, 409, 429, 500, 507)},
)
async def report(
    app: App, scan_id: Identifier, calibration: Which = "current", refine: Refine = False, wait: Patience = 30.0
) -> Response:
    """The poses of the views and their agreement; refined with `refine`. Progress is published on /events."""
    job = await app.scans.start_registration(scan_id, await calibration_of_scan(app, scan_id, calibration), refine)
    found = await _wait_for_report(job, wait)
    if found is None:
        return _in_progress(app, job, scan_id, refine)
    return Response(found.model_dump_json(), media_type=JSON)


@router.get(
    "/{scan_id}/cloud",
    response_class=Response,
    responses={200: {"description": "Every view in the base frame, mm, as the Accept header prefers",
                     "content": CONTENT},
               **STILL, **problem_responses(404, 406, 409, 413, 415, 429, 500, 507)},
)  # fmt: skip
async def cloud(
    request: Request,
    app: App,
    scan_id: Identifier,
    calibration: Which = "current",
    refine: Refine = False,
    view: OneView = None,
    voxel_mm: Voxel = None,
    normals: Normals = False,
    outliers: Strays = "keep",
    box: BoxQuery = None,
    max_points: MostPoints = None,
    wait: Patience = 30.0,
) -> Response:
    """All views in one cloud, or one of them, in the robot's base frame: by the robot's poses, or refined."""
    merge = Merge(voxel_mm, normals, outliers, box_of(box), max_points)
    media_type = choose_media_type(request)
    used = await calibration_of_scan(app, scan_id, calibration)
    found = None
    if refine:
        job = await app.scans.start_registration(scan_id, used, refine)
        found = await _wait_for_report(job, wait)
        if found is None:
            return _in_progress(app, job, scan_id, refine)
    clouds = await app.scans.clouds(scan_id, used, found)
    poses = (await app.store.scan_views(scan_id))[: len(clouds)]
    if view is not None:
        clouds, poses = [_one_of(clouds, view, scan_id)], poses[view : view + 1]
    document = used.document
    merged = await app.scans.merge_views(scan_id, clouds, document.id, ANSWER_SUFFIXES[media_type], merge, view)
    headers = {"Handeyed-Calibration": document.id, "Handeyed-Frame": "base", "Vary": "Accept"}
    headers |= await app.service_workers.run(arm_headers, used, poses)
    if media_type != JSON:
        return TemporaryFileResponse(merged, media_type=media_type, headers=headers)
    try:
        content = await app.service_workers.run(_small_cloud, merged, document.id)
    finally:
        await app.service_workers.run(merged.unlink, missing_ok=True)
    return Response(content, media_type=JSON, headers=headers)


@router.get("/{scan_id}/surface", **in_content(SURFACE, {OCTETS: BINARY}, 404, 409, 415, 429, 500))
async def surface(
    app: App, scan_id: Identifier, view: SurfaceView, voxel_mm: SurfaceVoxel, calibration: Which = "current",
    box: BoxQuery = None,
) -> Response:  # fmt: skip
    """One view's points in base, averaged by cubes of `voxel_mm`, each with its normal and its distance from the other
    views: positive towards the camera, NaN where no other view is near."""
    clouds = await app.scans.clouds(scan_id, await calibration_of_scan(app, scan_id, calibration))
    _one_of(clouds, view, scan_id)
    content = await app.scans.view_surface(scan_id, clouds, view, voxel_mm, box_of(box))
    return Response(content, media_type=OCTETS)


async def calibration_of_scan(app: Application, scan_id: str, which: str) -> CalibrationInUse:
    """The active calibration ("current"), or by id, of the camera that the scan's scanner stands beside.

    Raises NoCalibration, NotFound, CalibrationUnusable.
    """
    camera = None
    if app.settings.cameras or app.settings.scanners:
        camera = app.settings.camera_beside((await app.store.scan(scan_id)).scanner)
    return await app.operations.calibrations.in_use(await app.operations.calibrations.find(which, camera))


def _one_of(clouds: list[PlacedCloud], view: int, scan_id: str) -> PlacedCloud:
    if view >= len(clouds):
        fix = Sentence("ask-up-to", last=len(clouds) - 1)
        raise NotFound(Sentence("no-such-view-of-scan", scan=scan_id, view=view), fix)
    return clouds[view]


async def _wait_for_report(job: ReportTask, seconds: float) -> RegistrationReportDocument | None:
    """Wait for the job's report; None when it is not done in time. Raises the job's exception."""
    done, _ = await asyncio.wait([job], timeout=seconds)
    return job.result() if done else None


def _in_progress(app: Application, job: ReportTask, scan_id: str, refine: bool) -> Response:
    link = f"/scans/{scan_id}/report" + ("?refine=true" if refine else "")
    progress = round(app.scans.registration_jobs.progress_of(job), 3)
    state = RegistrationState(state="in progress", progress=progress, links={"self": link, "events": "/events"})
    return Response(state.model_dump_json(), 202, {"Location": link, "Retry-After": "1"}, media_type=JSON)


def _small_cloud(octets: Path, calibration_id: str) -> bytes:
    """The JSON of a file of float32 x, y, z. Raises CloudTooLarge."""
    count = octets.stat().st_size // 12
    if count > MAX_JSON_POINTS:
        raise CloudTooLarge(
            f"the cloud has {count} points, more than the {MAX_JSON_POINTS} that travel as JSON",
            "set Accept: application/octet-stream for float32 x, y, z, or application/x-ply",
        )
    points = np.fromfile(octets, "<f4").reshape(-1, 3).tolist()
    fields = {"frame": "base", "unit": "mm", "calibration_id": calibration_id, "points": points}
    return CloudDocument.model_validate(fields).model_dump_json().encode()
