"""/session: a browser exchanges a key, or a pairing code, for a cookie."""

import socket
from typing import Annotated

from fastapi import Depends, Request, Response

from daemon.access.browser_sessions import MAX_SESSION_S, cookie_of
from daemon.access.roles import ROLES, Role
from daemon.api.dependencies import App, JsonBody, api_router, no_body
from daemon.api.middleware.authentication import caller_of, peer_of, session_of, session_token
from daemon.api.problems import problem_responses
from daemon.api.schemas.access import PairingDocument, SessionDocument, SignedInDocument
from daemon.http.connection_limiter import network_of
from daemon.model.requests import PairingRequest, SessionRequest
from daemon.runtime.version import SOFTWARE
from daemon.store.actor import current_audit_context

router = api_router(prefix="/session", tags=["access"])

LANGUAGES = ["en"]
"""The languages in which the daemon has its sentences; a page may have more, by their ids."""

SET_COOKIE = {"Set-Cookie": {"schema": {"type": "string"}, "description": "the session; HttpOnly, SameSite=Strict"}}


@router.post(
    "",
    response_model=SignedInDocument,
    status_code=201,
    responses={201: {"description": "Signed in", "headers": SET_COOKIE},
               **problem_responses(400, 401, 403, 413, 429, 500, 507)},
)  # fmt: skip
async def begin(
    request: Request, app: App, response: Response, body: Annotated[SessionRequest, Depends(JsonBody(SessionRequest))]
) -> SignedInDocument:
    """Sign a browser in with `key` or `code`: 12 hours at the most, and never longer than the key is valid.

    Ten attempts a minute and address.
    """
    peer = peer_of(request.scope)
    if body.key is not None:
        token, session, key = await app.sign_in.with_key(body.key, peer, network_of(peer))
    else:
        token, session, key = await app.sign_in.with_code(body.code or "", peer, network_of(peer))
    response.headers["Set-Cookie"] = cookie_of(request.url.scheme, token, MAX_SESSION_S)
    caller = app.sign_in.caller(session, key, also_idle=True)
    return SignedInDocument.model_validate(
        {"name": caller.name, "role": caller.role.word, "expires_at": session.expires_at}
    )


@router.get("", response_model=SessionDocument)
async def session(request: Request, app: App) -> SessionDocument:
    """Who is signed in, and what is asked for: "nobody" is asked, the "setup-code" makes the first key, or a "key"."""
    caller = caller_of(request)
    found = session_of(request)
    asked = "nobody" if caller.role > Role.VIEWER else "setup-code"
    if await app.store.access_keys.any_ever():
        asked = "key"
    return SessionDocument.model_validate(
        {
            "name": caller.name,
            "role": caller.role.word,
            "expires_at": None if found is None else found.expires_at,
            "asked": asked,
            "cell": app.settings.report.cell or socket.gethostname(),
            "software": SOFTWARE,
            "languages": LANGUAGES,
            "last_event_id": None if caller.role is Role.NOBODY else app.events.last,
        }
    )


@router.delete(
    "",
    status_code=204,
    response_class=Response,
    dependencies=[Depends(no_body)],
    responses={204: {"description": "Signed out; also when nobody was"}, **problem_responses(403, 500, 507)},
)
async def end(request: Request, app: App) -> Response:
    """Sign out: the session, its streams and its waits end."""
    token = session_token(request.scope)
    if session_of(request) is not None and token is not None:
        await app.sign_in.end(token, current_audit_context())
    return Response(status_code=204, headers={"Set-Cookie": cookie_of(request.url.scheme, "", 0)})


@router.post(
    "/touch",
    status_code=204,
    response_class=Response,
    dependencies=[Depends(no_body)],
    responses={204: {"description": "Noted"}, **problem_responses(400)},
)
async def touch(request: Request, app: App) -> Response:
    """Somebody is at the screen: without this or another act for [server] idle_minutes a session may only read."""
    if (found := session_of(request)) is not None:  # before the answer: the next request finds it noted
        await app.sign_in.touch(found)
    return Response(status_code=204)


@router.post("/pairing", response_model=PairingDocument, status_code=201, responses=problem_responses(400, 403, 413))
async def pair(
    request: Request, app: App, body: Annotated[PairingRequest, Depends(JsonBody(PairingRequest))]
) -> PairingDocument:
    """A code that signs another screen in, once, within five minutes, up to the caller's role.

    Made by a browser session, the other one ends no later than this one, and with it.
    """
    role = None if body.role is None else ROLES[body.role]
    code, expires_at, given = app.sign_in.pair(caller_of(request), session_of(request), role)
    return PairingDocument.model_validate({"code": code, "expires_at": expires_at, "role": given.word})
