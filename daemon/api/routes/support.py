"""POST /support-bundle."""

from collections.abc import Awaitable
from typing import Annotated

from fastapi import APIRouter, Depends, Response
from pydantic import BaseModel, RootModel

from daemon.api.dependencies import App, JsonBody
from daemon.api.problems import problem_responses
from daemon.api.readiness import readiness
from daemon.api.routes.cell import devices
from daemon.api.routes.health import health, metrics
from daemon.api.schemas.cell import DeviceDocument
from daemon.api.streaming.cloud_request import BINARY
from daemon.application import Application
from daemon.errors import DaemonError
from daemon.model.requests import SupportBundleRequest
from daemon.tools.support_bundle.bundle import gather_in_daemon
from drivers.errors import DeviceError

router = APIRouter(tags=["access"])

GZIP = "application/gzip"


@router.post(
    "/support-bundle",
    response_class=Response,
    responses={
        200: {"description": "A .tar.gz", "content": {GZIP: BINARY}},
        **problem_responses(400, 403, 413, 415, 429, 500),
    },
)
async def support_bundle(
    app: App, body: Annotated[SupportBundleRequest, Depends(JsonBody(SupportBundleRequest))]
) -> Response:
    """Settings as loaded, log, versions, runs, events and the audit log's state in one file, without secrets.

    Each text has at most 5 MB before it is packed, the `pictures` of the newest run 40 MB together. Nothing moves.
    """
    at = app.clock.utc_now()
    pages, lines = await _pages(app), app.recent_log.text()

    def make() -> bytes:
        return gather_in_daemon(app.settings, pages, lines, pictures=body.pictures).pack(at)

    content = await app.service_workers.run_if_free(make)
    name = f"handeyed-support-{at:%Y%m%d-%H%M%S}.tar.gz"
    return Response(content, media_type=GZIP, headers={"Content-Disposition": f'attachment; filename="{name}"'})


async def _pages(app: Application) -> dict[str, str]:
    """The answers of GET /health, /ready of each camera, /devices and /metrics, or why there is none."""

    async def list_devices() -> Response:
        found = [RootModel[DeviceDocument](device) for device in await devices(app)]
        return Response("\n".join(device.model_dump_json(indent=1) for device in found))

    asked: dict[str, Awaitable[BaseModel | Response]] = {
        "/health": health(app),
        "/devices": list_devices(),
        "/metrics": metrics(app),
        **{f"/ready-{camera.name}": readiness(app, camera) for camera in app.cameras.cameras},
    }
    return {path: await _text_of(answer) for path, answer in asked.items()}


async def _text_of(asked: Awaitable[BaseModel | Response]) -> str:
    try:
        answer = await asked
    except (DaemonError, DeviceError) as error:
        return f"no answer: {type(error).__name__}: {error}"
    return bytes(answer.body).decode() if isinstance(answer, Response) else answer.model_dump_json(indent=1)
