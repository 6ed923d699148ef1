"""Authentication, authorisation and audit of every request; sets the actor of what the request stores.

A request is known by its key (Authorization: Bearer), else by the cookie of a browser session.
"""

import logging
from contextlib import suppress

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.access.browser_sessions import BrowserSession, token_in
from daemon.access.errors import KeyMissing, RoleTooLow
from daemon.access.roles import LOCAL, LOCAL_READER, NOBODY, ROLES, SERVICE, Caller, Role, role_for
from daemon.api.http_errors import CrossOrigin
from daemon.api.middleware.abort_first import ABORT_PATH
from daemon.api.problems import answer, problem_of
from daemon.application import Application
from daemon.errors import DaemonError, StorageError
from daemon.http.connection_limiter import network_of
from daemon.http.connections import ON_AUTHENTICATED
from daemon.runtime.logs import LogLimit
from daemon.store.actor import AuditContext, acting_as

log = logging.getLogger(__name__)

NOT_AUDITED = ("/register", "/setup", "/session", "/keys")
"""Paths without an audit row: streamed clouds change nothing, and set-up, sessions and keys write their own rows."""

AS_THE_SERVICE = (
    "before the first key only root and the group handeyed may: commands find the key then, curl takes"
    " -H @/run/handeyed/authorization; or make a first key: handeyed keys add"
)

SAFE_METHODS = frozenset({"GET", "OPTIONS"})


class Authentication:
    """Keys as bearer tokens (RFC 6750). Requests from this machine need none until the first key exists."""

    def __init__(self, app: ASGIApp, application: Application) -> None:
        self._app, self._application = app, application
        self._keys = application.store.access_keys
        self._loopback = application.settings.server.loopback
        self._sign_in = application.sign_in
        self._refusals = LogLimit(application.clock.monotonic_s)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        needed = role_for(scope["method"], scope["path"])
        try:
            caller = await self._caller(scope, needed)
            if caller.role < needed:
                fix = AS_THE_SERVICE if caller == LOCAL_READER else None
                raise RoleTooLow(caller.name, caller.role.word, needed.word, fix)
        except DaemonError as error:
            # One line a minute and address, with the number of those left out.
            left_out = self._refusals.left_out(network_of(peer_of(scope)))
            if left_out is not None:
                more = f" ({left_out} more since the last such line)" if left_out else ""
                what = scope["method"], scope["path"], peer_of(scope), error.what, more
                log.warning("%s %s from %s is refused: %s%s", *what)
            await answer(problem_of(error), {"Connection": "close"})(scope, receive, send)
            return
        state = scope.setdefault("state", {})
        state["caller"] = caller
        if needed is not Role.NOBODY and (on_authenticated := state.get(ON_AUTHENTICATED)) is not None:
            on_authenticated()
        context = AuditContext(caller.name or peer_of(scope), caller.role.word, caller.key_id, session=caller.session)
        status = 0

        async def send_and_note(message: Message) -> None:
            nonlocal status
            status = message.get("status", status)
            await send(message)

        with acting_as(context), self._application.key_watch.watch(caller, state["connection"].end):
            await self._app(scope, receive, send_and_note)
        await self._audit(scope, context, status)
        touches = scope["method"] not in SAFE_METHODS and scope["path"] != "/setup/try"  # asked by a live picture, too
        if touches and (session := state.get("session")) is not None:
            await self._sign_in.touch(session)

    async def _caller(self, scope: Scope, needed: Role) -> Caller:
        """The caller by the request's key. Raises KeyMissing, CrossOrigin, SetupRefused, StorageError."""
        if needed is not Role.NOBODY:
            return await self._known_caller(scope)
        if scope["path"] == "/setup":
            await self._application.key_service.require_none()  # before the body is read
        if scope["path"] == "/session" and scope["method"] != "POST":
            with suppress(KeyMissing):
                return await self._known_caller(scope)
        return NOBODY

    async def _known_caller(self, scope: Scope) -> Caller:
        """The caller by the key or the cookie. Raises KeyMissing, CrossOrigin, StorageError.

        An abort is taken with a key as it was up to a second ago: it does not wait for a thread.
        """
        aborts = ABORT_PATH.fullmatch(scope["path"]) is not None
        given = next((value.decode("latin-1") for name, value in scope["headers"] if name == b"authorization"), "")
        scheme, _, key = given.partition(" ")
        service_key = self._application.service_key
        if service_key is not None and service_key.opens(key.strip()):
            return SERVICE
        if self._loopback and not await self._keys.any_ever(recent=aborts):
            return LOCAL if service_key is None or aborts else LOCAL_READER
        if scheme.lower() != "bearer":
            return await self._caller_of_session(scope)
        record = await self._keys.find(key.strip(), recent=aborts)
        if record is None:
            raise KeyMissing("this key is not known")
        if not record.valid(now := self._application.clock.timestamp()):
            raise KeyMissing(f"the key of {record.name!r} is {record.state(now)}")
        return Caller(record.name, ROLES[record.role], record.id)

    async def _caller_of_session(self, scope: Scope) -> Caller:
        """The caller by the cookie. An abort is taken with the session's full role, however long it was idle."""
        token = session_token(scope)
        if token is None:
            raise KeyMissing("this needs a key")
        headers = dict(scope["headers"])  # RequestChecks has refused every other origin
        of_own_page = b"origin" in headers or headers.get(b"sec-fetch-site") == b"same-origin"
        if scope["method"] not in SAFE_METHODS and not of_own_page:
            raise CrossOrigin("a cookie came without an Origin", "ask from a page of this daemon, or with a key")
        session, key = await self._sign_in.find(token)
        scope.setdefault("state", {})["session"] = session
        return self._sign_in.caller(session, key, also_idle=ABORT_PATH.fullmatch(scope["path"]) is not None)

    async def _audit(self, scope: Scope, context: AuditContext, status: int) -> None:
        """Append an audit row for a successful POST that stored nothing: changes have rows of their own."""
        if scope["method"] != "POST" or context.changes or status >= 400 or scope["path"].startswith(NOT_AUDITED):
            return
        at = self._application.clock.timestamp()
        try:
            await self._application.store.audit.append(context, at, "POST", scope["path"][:200], status=status)
        except StorageError as error:
            log.error("the audit log could not be written: %s", error)


def caller_of(request: Request) -> Caller:
    caller: Caller = request.scope["state"]["caller"]
    return caller


def session_of(request: Request) -> BrowserSession | None:
    """The browser session by whose cookie the caller is known; None for a caller with a key, or without one."""
    found: BrowserSession | None = request.scope["state"].get("session")
    return found


def session_token(scope: Scope) -> str | None:
    """The token of the request's session cookie; None without one."""
    cookies = (value.decode("latin-1") for name, value in scope["headers"] if name == b"cookie")
    return token_in(";".join(cookies), scope["scheme"])


def peer_of(scope: Scope) -> str:
    """The client's address, for people."""
    client = scope.get("client")
    return client[0] if client else "an unknown peer"
