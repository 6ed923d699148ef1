"""Routes of /sweeps: a line profiler's profiles in base while the arm moves."""

import logging
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, BinaryIO

from fastapi import APIRouter, Depends, Response
from fastapi.responses import StreamingResponse
from starlette.types import Send

from daemon.api.dependencies import App, Identifier, JsonBody
from daemon.api.problems import problem_responses
from daemon.api.routes.register import Which
from daemon.api.streaming.cloud_request import BINARY
from daemon.application import Application
from daemon.config.settings import MAIN_SCANNER
from daemon.errors import DaemonError
from drivers.errors import DeviceError
from extensions.sweeps.recorder import POINT_BYTES, Sweep
from extensions.sweeps.requests import SweepRequest
from extensions.sweeps.schemas import SweepDocument
from extensions.sweeps.service import SweepService
from registration.errors import RegistrationError

log = logging.getLogger(__name__)

router = APIRouter(prefix="/sweeps", tags=["scans"])

OCTETS = "application/octet-stream"
CHUNK_BYTES = (1 << 18) // POINT_BYTES * POINT_BYTES


@router.post(
    "",
    operation_id="begin_sweep",
    response_model=SweepDocument,
    status_code=201,
    responses=problem_responses(400, 403, 404, 409, 413, 415, 422, 500, 503, 507),
)
async def begin(
    app: App, body: Annotated[SweepRequest, Depends(JsonBody(SweepRequest))], calibration: Which = "current"
) -> Response:
    """Begin a sweep of a line profiler. Nothing moves: move the arm by its own program, then end the sweep. No run
    starts meanwhile. Poses come from EGM where [robot.egm] is set, else from readings, at most 50 a second."""
    name = body.scanner or MAIN_SCANNER
    beside = app.settings.camera_beside(name) if app.settings.cameras or app.settings.scanners else None
    used = await app.operations.calibrations.find(calibration, beside)
    sweep = await app.service(SweepService).begin(used, name)
    document = SweepDocument.of(sweep).model_dump_json()
    return Response(document, 201, {"Location": f"/sweeps/{sweep.id}"}, media_type="application/json")


@router.get("/{sweep_id}", operation_id="get_sweep", response_model=SweepDocument, responses=problem_responses(404))
async def sweep(app: App, sweep_id: Identifier) -> SweepDocument:
    """A sweep as far as it has come. The last 8 are kept, until the daemon ends."""
    return SweepDocument.of(app.service(SweepService).get(sweep_id))


@router.post(
    "/{sweep_id}/end",
    operation_id="end_sweep",
    response_model=SweepDocument,
    responses=problem_responses(403, 404),
)
async def end(app: App, sweep_id: Identifier) -> SweepDocument:
    """End a sweep: what was measured up to now is put into base. One that is over stays as it is."""
    return SweepDocument.of(await app.service(SweepService).end(sweep_id))


@router.get(
    "/{sweep_id}/points",
    operation_id="get_sweep_points",
    response_class=Response,
    responses={200: {"description": "float32 x, y, z in base, mm, little-endian", "content": {OCTETS: BINARY}},
               **problem_responses(404)},
)  # fmt: skip
async def points(app: App, sweep_id: Identifier) -> Response:
    """The points of a sweep, from its first, while it runs; the answer ends with the sweep. When the sweep fails the
    connection is closed before the answer's end, and GET /sweeps/{id} names the error."""
    sweep = app.service(SweepService).get(sweep_id)
    headers = {"Handeyed-Calibration": sweep.calibration_id, "Handeyed-Frame": "base"}
    return PointsResponse(_points(app, sweep), media_type=OCTETS, headers=headers)


class PointsResponse(StreamingResponse):
    """Its end is sent only for a sweep that did not fail, so that clients detect one that did."""

    async def stream_response(self, send: Send) -> None:
        try:
            await super().stream_response(send)
        except (DeviceError, RegistrationError, DaemonError) as error:
            log.warning("the points of a sweep were cut off: %s", error)


async def _points(app: Application, sweep: Sweep) -> AsyncIterator[bytes]:
    """Pieces of the file as it grows. Raises the sweep's error."""
    file: BinaryIO | None = None
    try:
        sent = 0
        while True:
            async with sweep.grown:
                while sweep.points == sent and sweep.state == "running":
                    await sweep.grown.wait()
            if sweep.points == sent:
                break
            if file is None:
                opened = await app.service_workers.run(_open, sweep.file)
                file = opened
            wanted = min((sweep.points - sent) * POINT_BYTES, CHUNK_BYTES)
            piece = await app.service_workers.run(file.read, wanted)
            sent += len(piece) // POINT_BYTES
            yield piece
        if sweep.state == "failed":
            raise sweep.failure or DaemonError("the sweep was broken off", "begin it again")
    finally:
        if file is not None:
            file.close()


def _open(file: Path) -> BinaryIO:
    return file.open("rb")
