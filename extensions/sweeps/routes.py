"""Routes of /sweeps: a line profiler's profiles in base while the arm moves."""

import logging
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Annotated, BinaryIO, Literal

from fastapi import Depends, Response
from fastapi.responses import StreamingResponse
from starlette.types import Send

from calibration.documents.validation import Document
from daemon.api.dependencies import App, Identifier, JsonBody, api_router
from daemon.api.problems import problem_of, problem_responses
from daemon.api.routes.register import Which
from daemon.api.schemas.answer import EXAMPLE_AT, EXAMPLE_ID, Answer, example
from daemon.api.streaming.cloud_request import BINARY
from daemon.application import Application
from daemon.config.settings import MAIN_SCANNER, DeviceName
from daemon.errors import DaemonError
from daemon.model.requests import examples
from drivers.errors import DeviceError
from extensions.sweeps.recorder import POINT_BYTES, Sweep
from extensions.sweeps.service import SweepService
from registration.errors import RegistrationError


class SweepProblem(Answer):
    """Why a sweep has failed."""

    code: str
    detail: str


class SweepDocument(Answer):
    """A sweep of a line profiler. `points`: in base so far, at links.points.

    `left_out_profiles`: taken before the first pose or after the end. `lost_profiles`: counted by the sensor, and not
    sent. `largest_gap_s`: between two poses of the path.
    """

    model_config = example(
        id=EXAMPLE_ID, created_at=EXAMPLE_AT, scanner="scanner", calibration_id=EXAMPLE_ID, state="running",
        profiles=4000, points=5_120_000, poses=500, lost_profiles=0, left_out_profiles=12, largest_gap_s=0.004,
        problem=None, links={"self": f"/sweeps/{EXAMPLE_ID}", "points": f"/sweeps/{EXAMPLE_ID}/points"},
    )  # fmt: skip

    id: str
    created_at: str
    scanner: str
    calibration_id: str
    state: Literal["running", "done", "failed"]
    profiles: int
    points: int
    poses: int
    lost_profiles: int
    left_out_profiles: int
    largest_gap_s: float
    problem: SweepProblem | None
    links: dict[str, str]

    @classmethod
    def of(cls, sweep: Sweep) -> "SweepDocument":
        here, failure = f"/sweeps/{sweep.id}", sweep.failure
        found = None if failure is None else problem_of(failure)
        return cls(
            **vars(sweep),
            problem=None if found is None else SweepProblem(code=found.code, detail=found.detail),
            links={"self": here, "points": f"{here}/points", "end": f"{here}/end"},
        )  # fmt: skip


class SweepRequest(Document):
    """A sweep of a line profiler. `scanner`: name of one of [scanners]; [scanner] without it."""

    model_config = examples({}, {"scanner": "laser"})

    scanner: DeviceName | None = None


log = logging.getLogger(__name__)

router = api_router(prefix="/sweeps", tags=["scans"])

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
    async with AsyncExitStack() as stack:
        file: BinaryIO | None = None
        sent = 0
        while True:
            async with sweep.grown:
                while sweep.points == sent and sweep.state == "running":
                    await sweep.grown.wait()
            if sweep.points == sent:
                break
            if file is None:
                file = await stack.enter_async_context(app.service_workers.opened(_open, sweep.file))
            wanted = min((sweep.points - sent) * POINT_BYTES, CHUNK_BYTES)
            piece = await app.service_workers.run(file.read, wanted)
            sent += len(piece) // POINT_BYTES
            yield piece
        if sweep.state == "failed":
            raise sweep.failure or DaemonError("the sweep was broken off", "begin it again")


def _open(file: Path) -> BinaryIO:
    return file.open("rb")
