"""Sessions of clients: each has a key of the daemons, with which its requests are made.

A user name is any label, or LABEL@CELL; the password is a key of that cell's daemon, without @CELL of the first one.
The role, its end and the audit stay in the daemon.
"""

import asyncio
import hashlib
import logging
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
from asyncua.server import monitored_item_service as items
from asyncua.server.internal_server import InternalServer
from asyncua.server.internal_session import InternalSession
from cryptography.x509 import load_der_x509_certificate

from gateways.opcua.cell import Away, Cell, Refusal
from gateways.opcua.event_service import EventService

log = logging.getLogger(__name__)

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
        if not (username and password and password.isascii() and password.isprintable()):  # it goes into a header
            return None
        return KeyUser(label=username, key=password)


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
    _certificate = b""
    read, write, browse = _with_key("read"), _with_key("write"), _with_key("browse")
    translate_browsepaths_to_nodeids = _with_key("translate_browsepaths_to_nodeids")
    transfer_subscriptions = _with_key("transfer_subscriptions")
    create_monitored_items = _with_key("create_monitored_items")

    async def create_session(self, params: Any, sockname: Any = None) -> Any:
        """Make the session of a client with a trusted certificate. One that is never activated ends by its time."""
        try:
            if not params.ClientCertificate:  # asyncua would ask for none
                raise ServiceError(ua.StatusCodes.BadCertificateInvalid)
            made = await super().create_session(params, sockname)
        except Exception:
            await self.close_session()
            raise
        self._certificate, self._description = params.ClientCertificate, params.ClientDescription
        self._start_timeout_watchdog()
        return made

    def activate_session(self, params: Any, peer_certificate: bytes | None) -> Any:
        """Sign in, also as somebody else: the next service checks the key.

        The certificate must be the channel's: whoever copies a trusted one, or uses none, does not have its key.
        """
        if peer_certificate != self._certificate:
            raise ServiceError(ua.StatusCodes.BadSecurityChecksFailed)
        self._checked_s, self.connection = float("-inf"), weakref.ref(asyncio.current_task())
        return super().activate_session(params, peer_certificate)

    async def require_trusted(self) -> None:
        """Check the certificate and the key anew. Raises ServiceError."""
        await self.iserver.certificate_validator(load_der_x509_certificate(self._certificate), self._description)
        await self.require_key(now=True)

    async def require_key(self, *, now: bool = False) -> None:
        """Check the key when it was not within RECHECK_S; asyncua serves connections that were refused too."""
        if self.external and not now and self.connection() is not asyncio.current_task():
            raise ServiceError(ua.StatusCodes.BadSessionIdInvalid)
        if not self.external or not (now or time.monotonic() - self._checked_s > RECHECK_S):
            return
        if not isinstance(self.user, KeyUser):
            raise ServiceError(ua.StatusCodes.BadUserAccessDenied)
        await self.checks.require_valid(self.user)
        self._checked_s = time.monotonic()

    async def create_subscription(self, *arguments: Any, **named: Any) -> Any:
        """A subscription. asyncua names a log by it, which Python would keep, or what stands for its parent."""
        await self.require_key()
        made = await super().create_subscription(*arguments, **named)
        logging.getLogger(items.__name__).manager.loggerDict.pop(f"{items.__name__}.{made.SubscriptionId}", None)
        return made

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
        super().__init__(user_manager=KeyUsers())
        self.subscription_service = self.isession.subscription_service = EventService(self.aspace, self)

    def create_session(self, name: str, user: User | None = None, external: bool = False) -> InternalSession:
        """A session of a client; a connection, which is a task, has one. Its port may be one's that was cut off."""
        if external and any(one.connection() is asyncio.current_task() for one in self._external_sessions.values()):
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        nobody = user or User(role=UserRole.Anonymous)
        session = KeySession(self, self.aspace, self.subscription_service, name, user=nobody, external=external)
        session.checks = self._checks
        return session

    def register_external_session(self, session: InternalSession) -> None:
        """A client that was cut off returns to its session by this token, which asyncua counts up from 1000."""
        session.auth_token = ua.NodeId(secrets.token_hex(16))
        session.connection = weakref.ref(asyncio.current_task())
        super().register_external_session(session)

    async def end_revoked(self) -> None:
        """End every session whose key or certificate is no longer valid, until cancelled."""
        while True:
            await asyncio.sleep(RECHECK_S)
            await asyncio.gather(*map(_end_if_revoked, self._external_sessions.values()))


async def _end_if_revoked(session: KeySession) -> None:
    try:
        if session.is_activated():
            await session.require_trusted()
    except ServiceError as refused:
        if refused.code != ua.StatusCodes.BadCommunicationError:
            await asyncio.gather(session.close_session(), return_exceptions=True)  # the others go on
    except Exception:
        log.exception("a session's key was not checked")  # and the gateway goes on
