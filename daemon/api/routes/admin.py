"""POST /setup, GET /audit and whether it is whole, GET /settings and /about, POST /support-bundle."""

import json
from collections.abc import Awaitable
from typing import Annotated

from fastapi import Depends, Query, Request, Response
from pydantic import BaseModel, RootModel

from daemon.api.dependencies import IN_WHOLE_DIGITS, App, JsonBody, Limit, api_router, creates, in_content, respond_page
from daemon.api.problems import problem_responses
from daemon.api.readiness import readiness
from daemon.api.routes.cell import devices
from daemon.api.routes.health import health, metrics
from daemon.api.schemas.about import AboutDocument, SettingsDocument
from daemon.api.schemas.access import (
    AuditAnchorDocument,
    AuditDocument,
    AuditList,
    AuditVerifiedDocument,
    NewKeyDocument,
)
from daemon.api.schemas.answer import page_json
from daemon.api.schemas.cell import DeviceDocument
from daemon.api.streaming.cloud_request import BINARY
from daemon.application import Application
from daemon.errors import DaemonError
from daemon.model.requests import SetupRequest, SupportBundleRequest
from daemon.store.audit_log import check_audit_log
from daemon.store.database import DATABASE_NAME
from daemon.tools.support_bundle.bundle import about_software, gather_in_daemon, redact_values
from drivers.errors import DeviceError

router = api_router(tags=["access"])


@router.post("/setup", **creates(NewKeyDocument, 400, 403, 409, 413, 500, 507))
async def setup(
    request: Request, app: App, body: Annotated[SetupRequest, Depends(JsonBody(SetupRequest))]
) -> NewKeyDocument:
    """The first key, an admin's, for the set-up code that the daemon's log shows. It is shown this once."""
    peer = request.client.host if request.client else "unknown"
    key, record = await app.key_service.set_up(body.code, body.name, peer)
    return NewKeyDocument.model_validate({"key": key, **vars(record)})


Sequence = Annotated[
    int | None, Query(ge=1, le=2**62, description="cursor: the last sequence of the page before"), IN_WHOLE_DIGITS
]


@router.get("/audit", response_model=AuditList)
async def audit(app: App, limit: Limit = 50, before: Sequence = None) -> Response:
    """Who did what, the newest first. `handeyed audit verify` checks that nothing was changed or removed."""
    found = await app.store.audit.rows(limit + 1, before)
    following = f"/audit?limit={limit}&before={found[limit - 1].sequence}" if len(found) > limit else None

    def as_json() -> bytes:
        rows = [AuditDocument(**vars(row) | {"detail": json.loads(row.detail)}) for row in found[:limit]]
        return page_json({"rows": rows}, following)

    return await respond_page(app, as_json)


@router.get("/audit/verified", response_model=AuditVerifiedDocument, responses=problem_responses(429, 500))
async def audit_verified(app: App) -> AuditVerifiedDocument:
    """Whether the audit log is whole, by a look at each of its rows, as `handeyed audit verify` takes."""
    rows = await app.store.audit.rows(1, None)
    checked_at = app.clock.timestamp()
    count, flaws = await app.service_workers.run_if_free(check_audit_log, app.store.folder / DATABASE_NAME, [])
    return AuditVerifiedDocument(
        whole=not flaws,
        rows=count,
        last=AuditAnchorDocument(sequence=rows[0].sequence, hash=rows[0].hash) if rows else None,
        flaws=flaws[:20],
        checked_at=checked_at,
    )


@router.get("/settings", response_model=SettingsDocument, tags=["access"])
async def settings(app: App) -> SettingsDocument:
    """The settings as the daemon has loaded them, without passwords, keys and tokens; `given`: those of the file."""
    loaded = app.settings
    return SettingsDocument(
        settings=redact_values(loaded.model_dump(mode="json")),
        given=redact_values(loaded.model_dump(mode="json", exclude_unset=True)),
    )


@router.get("/about", response_model=AboutDocument, tags=["health"])
async def about(app: App) -> Response:
    """The version of the daemon and of the packages it uses, with their licences, and which settings file it loaded."""
    loaded = None if app.settings_file is None else vars(app.settings_file)

    def as_json() -> bytes:
        return AboutDocument.model_validate({**about_software(), "settings": loaded}).model_dump_json().encode()

    return await respond_page(app, as_json)


GZIP = "application/gzip"


@router.post("/support-bundle", **in_content("A .tar.gz", {GZIP: BINARY}, 400, 403, 413, 415, 429, 500))
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
        **{f"/ready-{camera.name}": readiness(app, camera) for camera in app.cameras},
    }
    return {path: await _text_of(answer) for path, answer in asked.items()}


async def _text_of(asked: Awaitable[BaseModel | Response]) -> str:
    try:
        answer = await asked
    except (DaemonError, DeviceError) as error:
        return f"no answer: {type(error).__name__}: {error}"
    return bytes(answer.body).decode() if isinstance(answer, Response) else answer.model_dump_json(indent=1)
