"""Parts larger than one view: scans, their views, the cloud in one piece."""

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from calibration.documents.pose import PoseDocument
from daemon.api.access import App, Identifier, Limit, Wait, body_of, takes
from daemon.api.clouds import TAKES_A_CLOUD, PoseQuery, UnitQuery, media_type_of, parse_pose
from daemon.api.documents import ScanDocument, ScanList, ScanViewDocument
from daemon.api.problems import documented
from daemon.api.register import Which
from daemon.application import Application
from daemon.requests import ScanRequest
from daemon.store.records import RunRecord, ScanView

router = APIRouter(prefix="/scans", tags=["scans"])

BODY_REFUSALS = (400, 403, 404, 409, 413, 415, 500, 502, 503, 504, 507)


@router.get("", response_model=ScanList)
async def scans(app: App, limit: Limit = 50) -> ScanList:
    """The newest first."""
    found = await app.store.scans(limit)
    return ScanList(scans=[ScanDocument.of(scan, await app.store.scan_views(scan.id)) for scan in found])


@router.post(
    "",
    response_model=ScanDocument,
    status_code=201,
    responses={202: {"description": "The arm is driven to fill it; follow run.links", "model": ScanDocument},
               **documented(*BODY_REFUSALS)},
    openapi_extra=takes(ScanRequest),
)  # fmt: skip
async def create(app: App, body: Annotated[ScanRequest, Depends(body_of(ScanRequest))], wait: Wait = 0.0) -> Response:
    """A new scan, for clouds you send; or with `capture` or `poses` one that the daemon's scanner fills."""
    scan, run = await app.operations.scan(body)
    if run is not None and wait > 0:
        run = await app.supervisor.wait(run.id, wait)
    document = ScanDocument.of(scan, await app.store.scan_views(scan.id), run)
    status, headers = _started(run)
    return Response(
        document.model_dump_json(), status, {"Location": f"/scans/{scan.id}", **headers}, media_type="application/json"
    )


def _started(run: RunRecord | None) -> tuple[int, dict[str, str]]:
    return (201, {}) if run is None or run.over else (202, {"Retry-After": "1"})


@router.get("/{scan_id}", response_model=ScanDocument, responses=documented(404))
async def scan(app: App, scan_id: Identifier) -> ScanDocument:
    """A scan and its views."""
    return ScanDocument.of(await app.store.scan(scan_id), await app.store.scan_views(scan_id))


@router.post(
    "/{scan_id}/views",
    response_model=ScanViewDocument,
    status_code=201,
    openapi_extra=TAKES_A_CLOUD,
    responses=documented(*BODY_REFUSALS),
)
async def add_view(
    request: Request, app: App, scan_id: Identifier, pose: PoseQuery = "now", unit: UnitQuery = "mm"
) -> ScanViewDocument:
    """A cloud seen from `pose`; without a body the daemon's scanner takes one where the arm stands."""
    await app.store.scan(scan_id)
    if _has_no_body(request):
        view = await app.operations.scan_here(scan_id)
    else:
        view = await _upload(request, app, scan_id, pose, unit)
    return ScanViewDocument.of(view)


async def _upload(request: Request, app: Application, scan_id: str, pose: str, unit: UnitQuery) -> ScanView:
    media_type = media_type_of(request)
    base_T_flange: PoseDocument = await app.operations.pose_now() if pose == "now" else parse_pose(pose)
    return await app.scans.keep(scan_id, request.stream(), media_type, unit, base_T_flange)


def _has_no_body(request: Request) -> bool:
    return request.headers.get("content-length", "0") == "0" and "transfer-encoding" not in request.headers


@router.get(
    "/{scan_id}/cloud",
    response_class=Response,
    responses={200: {"description": "Every view in the base frame, mm, as one PLY",
                     "content": {"application/x-ply": {"schema": {"type": "string", "format": "binary"}}}},
               **documented(404, 409, 500, 507)},
)  # fmt: skip
async def cloud(app: App, scan_id: Identifier, calibration: Which = "current") -> Response:
    """All views in one cloud, in the robot's base frame."""
    document = await app.operations.calibration(calibration)
    merged = await app.scans.merged(scan_id, document)
    return FileResponse(
        merged,
        media_type="application/x-ply",
        headers={"Handeyed-Calibration": document.id},
        background=BackgroundTask(app.workers.run, merged.unlink, missing_ok=True),
    )
