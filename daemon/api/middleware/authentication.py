"""Authentication, authorisation and audit of every request; sets the actor of what the request stores."""

import logging

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.access.errors import KeyMissing, RoleTooLow
from daemon.access.policy import role_for
from daemon.access.roles import LOCAL, NOBODY, ROLES, Caller, Role
from daemon.api.problems import answer, problem_of
from daemon.application import Application
from daemon.errors import DaemonError, StorageError
from daemon.http.connection_limiter import network_of
from daemon.http.connections import ON_AUTHENTICATED
from daemon.runtime.log_limit import LogLimit
from daemon.store.actor import AuditContext, acting_as

log = logging.getLogger(__name__)

NOT_AUDITED = ("/register", "/setup")
"""Paths without an audit row: streamed clouds change nothing, and the set-up writes its own rows."""


class Authentication:
    """Keys as bearer tokens (RFC 6750). Requests from this machine need none until the first key exists."""

    def __init__(self, app: ASGIApp, application: Application) -> None:
        self._app, self._application = app, application
        self._keys = application.store.access_keys
        self._loopback = application.settings.server.loopback
        self._refusals = LogLimit(application.clock.monotonic_s)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        needed = role_for(scope["method"], scope["path"])
        try:
            caller = await self._caller(scope, needed)
            if caller.role < needed:
                raise RoleTooLow(caller.name, caller.role.word, needed.word)
        except DaemonError as error:
            self._log_refusal(scope, error)
            await answer(problem_of(error), {"Connection": "close"})(scope, receive, send)
            return
        state = scope.setdefault("state", {})
        state["caller"] = caller
        if needed is not Role.NOBODY and (on_authenticated := state.get(ON_AUTHENTICATED)) is not None:
            on_authenticated()
        context = AuditContext(caller.name or _peer(scope), caller.role.word, caller.key_id)
        status = 0

        async def send_and_note(message: Message) -> None:
            nonlocal status
            status = message.get("status", status)
            await send(message)

        with acting_as(context), self._application.key_watch.watch(caller, state["connection"].end):
            await self._app(scope, receive, send_and_note)
        await self._audit(scope, context, status)

    def _log_refusal(self, scope: Scope, error: DaemonError) -> None:
        """Log a refused request: one line a minute and address, with the number of those left out."""
        left_out = self._refusals.left_out(network_of(_peer(scope)))
        if left_out is not None:
            more = f" ({left_out} more since the last such line)" if left_out else ""
            what = scope["method"], scope["path"], _peer(scope), error.what, more
            log.warning("%s %s from %s is refused: %s%s", *what)

    async def _caller(self, scope: Scope, needed: Role) -> Caller:
        """The caller by the request's key. Raises KeyMissing, SetupRefused, StorageError."""
        if needed is Role.NOBODY:
            if scope["path"] == "/setup":
                await self._application.key_service.require_none()  # before the body is read
            return NOBODY
        if self._loopback and not await self._keys.any_ever():
            return LOCAL
        scheme, _, key = _authorization(scope).partition(" ")
        if scheme.lower() != "bearer":
            raise KeyMissing("this needs a key")
        record = await self._keys.find(key.strip())
        if record is None:
            raise KeyMissing("this key is not known")
        if not record.valid(now := self._application.clock.timestamp()):
            raise KeyMissing(f"the key of {record.name!r} is {record.state(now)}")
        return Caller(record.name, ROLES[record.role], record.id)

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
    """The authenticated caller of a request."""
    caller: Caller = request.scope["state"]["caller"]
    return caller


def _authorization(scope: Scope) -> str:
    return next((value.decode("latin-1") for name, value in scope["headers"] if name == b"authorization"), "")


def _peer(scope: Scope) -> str:
    client = scope.get("client")
    return client[0] if client else "an unknown peer"
