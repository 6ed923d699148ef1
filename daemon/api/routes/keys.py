"""/keys: make, rotate and revoke keys, as `handeyed keys` does."""

from typing import Annotated, Any

from fastapi import Depends

from daemon.access.keys import KeyRecord
from daemon.access.roles import ROLES
from daemon.api.dependencies import App, Identifier, JsonBody, api_router, no_body
from daemon.api.problems import problem_responses
from daemon.api.schemas.access import KeyList, NewKeyDocument, RevokedKeys
from daemon.application import Application
from daemon.model.requests import NewKeyRequest, RotateKeyRequest
from daemon.store.actor import current_audit_context

router = api_router(prefix="/keys", tags=["access"])

REFUSALS: dict[int | str, dict[str, Any]] = problem_responses(400, 403, 404, 409, 413, 500, 507)


@router.get("", response_model=KeyList)
async def keys(app: App) -> KeyList:
    """All keys, oldest first, also those that have ended; never the key itself."""
    now = app.clock.timestamp()
    rows = [{**vars(record), "state": record.state(now)} for record in await app.store.access_keys.all()]
    return KeyList.model_validate({"keys": rows})


@router.post("", response_model=NewKeyDocument, status_code=201, responses=REFUSALS)
async def add(app: App, body: Annotated[NewKeyRequest, Depends(JsonBody(NewKeyRequest))]) -> NewKeyDocument:
    """A new key. It is shown this once."""
    made = await app.key_service.add(body.name, ROLES[body.role], current_audit_context(), body.days)
    return _answer(app, "added", *made)


@router.post("/{name}/rotate", response_model=NewKeyDocument, status_code=201, responses=REFUSALS)
async def rotate(
    app: App, name: Identifier, body: Annotated[RotateKeyRequest, Depends(JsonBody(RotateKeyRequest))]
) -> NewKeyDocument:
    """A new key in place of the valid one of that name or id. It is shown this once."""
    made = await app.key_service.rotate(name, current_audit_context(), body.days, body.overlap_h)
    return _answer(app, "rotated", *made)


@router.post("/{name}/revoke", response_model=RevokedKeys, dependencies=[Depends(no_body)], responses=REFUSALS)
async def revoke(app: App, name: Identifier) -> RevokedKeys:
    """End the valid keys of that name or id now, with their sessions and streams."""
    ended = await app.key_service.revoke(name, current_audit_context())
    app.events.publish("key", {"action": "revoked", "ids": ended, "at": app.clock.timestamp()})
    return RevokedKeys(revoked=ended)


def _answer(app: Application, action: str, key: str, record: KeyRecord) -> NewKeyDocument:
    app.events.publish("key", {"action": action, "ids": [record.id], "at": record.created_at})
    return NewKeyDocument.model_validate({"key": key, **vars(record)})
