"""POST /setup and GET /audit."""

import json
from collections.abc import Iterator
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response

from daemon.api.dependencies import IN_WHOLE_DIGITS, App, JsonBody, Limit, respond_page
from daemon.api.problems import problem_responses
from daemon.api.schemas.access import AuditDocument, AuditList, NewKeyDocument
from daemon.api.schemas.answer import page_json
from daemon.model.requests import SetupRequest

router = APIRouter(tags=["access"])


@router.post(
    "/setup",
    response_model=NewKeyDocument,
    status_code=201,
    responses=problem_responses(400, 403, 409, 413, 500, 507),
)
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
        rows: Iterator[Any] = ({**vars(row), "detail": json.loads(row.detail)} for row in found[:limit])
        return page_json("rows", (AuditDocument(**row).model_dump_json() for row in rows), following)

    return await respond_page(app, as_json)
