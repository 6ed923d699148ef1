"""Sessions of clients: each has a key of the daemons, with which its requests are made.

A user name is any label, or LABEL@CELL; the password is a key of that cell's daemon, without @CELL of the first one.
The role, its end and the audit stay in the daemon.
"""

import hashlib
import secrets
import time
import weakref
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession

from gateways.opcua.cell import Away, Cell, Refusal

RECHECK_S = 30.0
"""A session's key is checked again after so long, and the session ends with it."""

session_key: ContextVar[str | None] = ContextVar("session_key", default=None)
"""The key of the session whose method is called."""


@dataclass
class KeyUser(User):  # type: ignore[misc] # asyncua's names are made while it runs
    """A signed-in client. `key`: its password; `label`: its user name."""

    role: Any = UserRole.User
    label: str = ""
    key: str = ""


class KeyUsers:
    """asyncua's user manager: everybody with a user name and a password, which the session then checks."""

    def get_user(
        self, iserver: InternalServer, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        """Called while a session is activated, where nothing can be waited for; None refuses it."""
        return KeyUser(label=username, key=password) if username and password else None


class KeyChecks:
    """Asks the daemons whether a key is valid, and remembers those that were."""

    def __init__(self, cells: Mapping[str, Cell]) -> None:
        self._cells = cells
        self._valid: set[bytes] = set()

    async def require_valid(self, user: KeyUser) -> None:
        """Raises ServiceError. While the daemon is away, keys that were valid before are."""
        name = user.label.rpartition("@")[2] if "@" in user.label else next(iter(self._cells))
        cell, mark = self._cells.get(name), hashlib.sha256(f"{name} {user.key}".encode()).digest()
        if cell is None:
            raise ServiceError(ua.StatusCodes.BadUserAccessDenied)
        try:
            await cell.get("/runs", user.key, limit=1)
            self._valid.add(mark)
        except Refusal as refusal:
            if refusal.status in (401, 403):
                self._valid.discard(mark)
                raise ServiceError(ua.StatusCodes.BadUserAccessDenied) from None
            raise ServiceError(ua.StatusCodes.BadCommunicationError) from None
        except Away:
            if mark not in self._valid:
                raise ServiceError(ua.StatusCodes.BadCommunicationError) from None


def _with_key(service: str) -> Any:
    """This service of asyncua's session, refused with ServiceError without a valid key."""

    async def serve(self: "KeySession", *arguments: Any, **named: Any) -> Any:
        await self.require_key()
        return await getattr(super(KeySession, self), service)(*arguments, **named)

    return serve


class KeySession(InternalSession):  # type: ignore[misc]
    """A session whose services are refused without a valid key, and whose methods are called with it."""

    checks: KeyChecks
    _checked_s = float("-inf")
    read, write, browse = _with_key("read"), _with_key("write"), _with_key("browse")
    translate_browsepaths_to_nodeids = _with_key("translate_browsepaths_to_nodeids")
    create_subscription, transfer_subscriptions = _with_key("create_subscription"), _with_key("transfer_subscriptions")
    create_monitored_items = _with_key("create_monitored_items")

    def activate_session(self, *arguments: Any, **named: Any) -> Any:
        """Sign in, also as somebody else: the next service checks the key."""
        self._checked_s = float("-inf")
        return super().activate_session(*arguments, **named)

    async def require_key(self, *, now: bool = False) -> None:
        """Check the key when it was not within RECHECK_S. Raises ServiceError."""
        if not self.external or not (now or time.monotonic() - self._checked_s > RECHECK_S):
            return
        if not isinstance(self.user, KeyUser):
            raise ServiceError(ua.StatusCodes.BadUserAccessDenied)
        await self.checks.require_valid(self.user)
        self._checked_s = time.monotonic()

    async def call(self, params: Any) -> Any:
        """Call methods, with the session's key at hand."""
        await self.require_key()
        token = session_key.set(self.user.key if isinstance(self.user, KeyUser) else None)
        try:
            return await super().call(params)
        finally:
            session_key.reset(token)


class KeyServer(InternalServer):  # type: ignore[misc]
    """asyncua's core with sessions that have keys."""

    def __init__(self, checks: KeyChecks) -> None:
        self._checks = checks
        self.sessions: weakref.WeakSet[KeySession] = weakref.WeakSet()
        super().__init__(user_manager=KeyUsers())

    def create_session(self, name: str, user: User | None = None, external: bool = False) -> InternalSession:
        """A session of a client."""
        nobody = user or User(role=UserRole.Anonymous)
        session = KeySession(self, self.aspace, self.subscription_service, name, user=nobody, external=external)
        session.checks = self._checks
        if external:
            self.sessions.add(session)
        return session

    def register_external_session(self, session: InternalSession) -> None:
        """A client that was cut off returns to its session by this token, which asyncua counts up from 1000."""
        session.auth_token = ua.NodeId(secrets.token_hex(16))
        super().register_external_session(session)

    async def end_revoked(self) -> None:
        """End every session whose key is no longer valid."""
        for session in list(self.sessions):
            if session.is_activated():
                try:
                    await session.require_key(now=True)
                except ServiceError as refused:
                    if refused.code == ua.StatusCodes.BadUserAccessDenied:
                        await session.close_session()
