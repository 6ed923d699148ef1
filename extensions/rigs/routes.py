"""POST and GET /rigs: several cameras and scanners on one mount by name, as `handeyed solve --together` makes them."""

from typing import Annotated

from fastapi import Depends, Query, Request, Response

from calibration.documents.rig import RigDocument
from daemon.access.errors import RoleTooLow
from daemon.access.roles import Role
from daemon.api.dependencies import App, Before, Identifier, JsonBody, Limit, api_router, respond_rows
from daemon.api.middleware.authentication import caller_of
from daemon.api.negotiation import respond_created
from daemon.api.problems import problem_responses
from daemon.api.schemas.answer import Answer, StoredAnswer
from extensions.rigs.rig_sensors import STORED_RIGS, RigSensors

router = api_router(prefix="/rigs", tags=["calibrations"])

Despite = Annotated[bool, Query(description="also a rig that was not accepted")]


class StoredRig(StoredAnswer):
    """A rig.json as it was stored. The newest one is active."""

    rig: RigDocument


class RigList(Answer):
    """The newest first, which is active; `next` asks for those before them. `damaged`: ids that cannot be read."""

    rigs: list[StoredRig]
    damaged: list[str]
    next: str | None


@router.post(
    "", operation_id="store_rig", response_model=StoredRig, status_code=201,
    responses=problem_responses(400, 403, 409, 413, 422, 429, 500, 507),
)  # fmt: skip
async def store_rig(
    request: Request,
    app: App,
    body: Annotated[RigDocument, Depends(JsonBody(RigDocument))],
    despite_verdict: Despite = False,
) -> Response:
    """Store a rig.json, and activate it: POST /register?scanner=NAME then uses the pose of that sensor.

    A verdict is overruled by admins only.
    """
    caller = caller_of(request)
    if despite_verdict and caller.role < Role.ADMIN:
        raise RoleTooLow(caller.name, caller.role.word, Role.ADMIN.word)
    record = await RigSensors(app.operations).save(body, app.new_id(), despite_verdict=despite_verdict)
    return respond_created(StoredRig.of_record(record), f"/rigs/{record.id}")


@router.get("", operation_id="list_rigs", response_model=RigList)
async def rigs(app: App, limit: Limit = 50, before: Before = None) -> Response:
    """The rigs, newest first."""
    found = await app.store.documents(STORED_RIGS).page(limit + 1, before)
    return await respond_rows(app, found, limit, "/rigs", StoredRig.of_record)


@router.get("/{rig_id}", operation_id="get_rig", response_model=StoredRig, responses=problem_responses(404))
async def rig(app: App, rig_id: Identifier) -> StoredRig:
    """One rig."""
    return StoredRig.of_record(await app.store.documents(STORED_RIGS).get(rig_id))
