"""One service as an ASGI application: authentication, rate limit, media types, then the table of routes."""

import asyncio
import base64
import binascii
import hashlib
import re
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from starlette.requests import Request
from starlette.responses import HTMLResponse
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket

from mock_robot.rws.context import RequestContext
from mock_robot.rws.documents import JSON_1, JSON_2, XHTML_1, XHTML_2, Encoding, subscription_created
from mock_robot.rws.exchange import DONE, Reply, RwsRequest, parse
from mock_robot.rws.mastership import PENDANT
from mock_robot.rws.refusals import GONE, NO_RESOURCE, NOT_ACCEPTABLE, UNSUPPORTED_MEDIA, RwsRefused
from mock_robot.rws.routes import answer_request
from mock_robot.rws.sessions import Session, Sessions, SessionsExhausted
from mock_robot.rws.subscriptions import PERIODS_S, SubscriptionGroup, Subscriptions
from mock_robot.rws.world import World

PASSWORDS = {"Default User": "robotics", "Admin": "robotics", "admin": "robotics"}
SLOW_S = 1.0
"""Delay of responses under the fault `rws-slow`."""


SUBPROTOCOLS = {1: "robapi2_subscription", 2: "rws_subscription"}
POLICY_VIOLATION, GOING_AWAY = 1008, 1001
POLL_S = PERIODS_S[2]


@dataclass
class Polls:
    """Open WebSockets of one service. In RWS 2.0 any message from the client closes the socket with code 1008."""

    subscriptions: Subscriptions
    clock: Callable[[], float]
    _nudge: asyncio.Event = field(default_factory=asyncio.Event, init=False)

    def nudge(self) -> None:
        self._nudge.set()

    async def serve(self, socket: WebSocket, session: Session | None) -> None:
        """Serve one socket from handshake to close."""
        await socket.receive()  # the connection
        wanted = SUBPROTOCOLS[self.subscriptions.version]
        number = socket.url.path.removeprefix("/poll/")
        group = self.subscriptions.groups.get(int(number)) if number.isdecimal() else None
        refused = self._refusal(socket, wanted, group, session)
        if refused is not None or group is None:
            await socket.send_denial_response(HTMLResponse("<html>Refused</html>", refused or 404))
            return
        group.taken = True
        await socket.accept(wanted)
        try:
            await self._report(group, socket)
        finally:
            self.subscriptions.delete(group.number)

    def _refusal(
        self, socket: WebSocket, wanted: str, group: SubscriptionGroup | None, session: Session | None
    ) -> int | None:
        """HTTP status that refuses a handshake; None when it is accepted."""
        if wanted not in socket.scope["subprotocols"]:
            return 400
        if session is None:
            return 403 if self.subscriptions.version == 1 else 401
        if group is None or group.session is not session or group.taken:
            return 404
        return None

    async def _report(self, group: SubscriptionGroup, socket: WebSocket) -> None:
        hearing = asyncio.ensure_future(socket.receive())
        try:
            while group.number in self.subscriptions.groups:
                for message in group.events(self.clock()):
                    await socket.send_text(message)
                await asyncio.wait({hearing}, timeout=POLL_S)
                if not hearing.done():
                    continue
                if hearing.result()["type"] == "websocket.disconnect":
                    return
                if self.subscriptions.version == 2:
                    await socket.close(POLICY_VIOLATION, "Client cannot send data.")
                    return
                hearing = asyncio.ensure_future(socket.receive())  # RWS 1.0 ignores messages
            await socket.close(GOING_AWAY)
        finally:
            hearing.cancel()


class Unauthorized(Exception):
    """Missing or wrong credentials: 401."""


@dataclass
class Service:
    """RWS `version` of a world. Sessions and subscriptions belong to the service, mastership to the world."""

    world: World
    version: int
    _known_session: int = field(init=False)

    def __post_init__(self) -> None:
        self.sessions = Sessions(self._end_session)
        self.subscriptions = Subscriptions(self.world, self.version)
        self.polls = Polls(self.subscriptions, self.world.clock)
        self._digest = DigestAuth(PASSWORDS)
        self._known_session = self.world.cabinet.session

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.react_to_controller()
        if scope["type"] == "websocket":
            await self.polls.serve(WebSocket(scope, receive, send), self._session_of(_headers(scope)))
        elif scope["type"] == "http":
            await self._serve(scope, await Request(scope, receive).body(), send)

    def react_to_controller(self) -> None:
        """React to changes of the controller: a restart drops all sessions, faults take effect."""
        if self.world.cabinet.session != self._known_session:
            self._known_session = self.world.cabinet.session
            self.world.take_configuration()
            self.sessions.end_all()
            self._digest.forget()
            self.subscriptions.forget()
        faults, now_s = self.world.faults, self.world.clock()
        if faults.is_on("rws-401"):
            self.sessions.end_all()
        if faults.is_on("rws-sessions-exhausted"):
            self.sessions.end_all()
            self.sessions.fill_up(now_s)
        else:
            self.sessions.end_all("somebody else")
        if faults.is_on("rws-mastership-held"):
            self.world.mastership.take_locally()
        else:
            self.world.mastership.release_all(PENDANT)
        if faults.is_on("rws-subscription-gone"):
            self.subscriptions.forget(silently=True)
        self.polls.nudge()

    async def _serve(self, scope: Scope, body: bytes, send: Send) -> None:
        headers = _headers(scope)
        base = f"{scope['scheme']}://{headers.get('host', '127.0.0.1')}/"
        asked = parse(scope["method"], scope["raw_path"], scope["query_string"], headers, body, base)
        writing = self._writing(asked)
        session: Session | None = None
        cookies: list[tuple[str, str]] = []
        try:
            session, cookies = self._admit(asked)
            slow_s = SLOW_S if self.world.faults.strike("rws-slow") else 0.0
            await asyncio.sleep(slow_s + self.sessions.wait_s(session, self.world.clock()))
            reply = self._answer(asked, session).cut(asked.query)
        except Unauthorized:
            challenge = 'Basic realm="validusers@robapi.abb"' if self.version == 2 else self._digest.challenge(
                headers.get("host", ""), stale="nonce" in headers.get("authorization", ""))  # fmt: skip
            await _respond(send, 401, "text/html", b"<html>Unauthorized</html>", [("www-authenticate", challenge)])
        except SessionsExhausted:
            await _respond(send, 503, "text/html", b"<html>Service Unavailable</html>", cookies)
        except RwsRefused as refused:
            content = writing.refusal(refused, base).encode()
            await _respond(send, refused.status, writing.media_type, content, cookies)
        else:
            await self._write(send, writing, reply, asked, cookies)

    def _admit(self, asked: RwsRequest) -> tuple[Session, list[tuple[str, str]]]:
        """The session, and the cookies of a new one. Raises Unauthorized, SessionsExhausted."""
        faults = self.world.faults
        if faults.strike("rws-503"):
            raise SessionsExhausted
        if faults.strike("rws-401"):
            raise Unauthorized
        session = self._session_of(asked.headers)
        if session is not None:
            return session, []
        user = self._user(asked.headers.get("authorization", ""), asked.method)
        if user is None:
            raise Unauthorized
        session = self.sessions.open(user, self.world.clock())
        return session, session.cookies

    def _session_of(self, headers: Mapping[str, str]) -> Session | None:
        return self.sessions.find(headers.get("cookie", ""), self.world.clock())

    def _user(self, authorization: str, method: str) -> str | None:
        if self.version == 1:
            return self._digest.user(authorization, method)
        scheme, _, secret = authorization.partition(" ")
        try:
            user, _, password = base64.b64decode(secret, validate=True).decode().partition(":")
        except (binascii.Error, UnicodeDecodeError):
            return None
        return user if scheme.lower() == "basic" and PASSWORDS.get(user) == password else None

    def _answer(self, asked: RwsRequest, session: Session) -> Reply:
        self._require_media_types(asked)
        if asked.path.startswith("/subscription"):
            return self._subscription(asked, session)
        if asked.path == "/logout" and asked.method == "GET":
            self.sessions.end(session)
            return DONE
        if self.version == 2 and asked.path.startswith("/rw/mastership") and self.world.faults.strike("rws-410"):
            raise RwsRefused(GONE)
        context = RequestContext(self.world, self.version, session, asked, self.world.clock())
        return answer_request(context)

    def _subscription(self, asked: RwsRequest, session: Session) -> Reply:
        if asked.method == "POST" and asked.path == "/subscription":
            group = self.subscriptions.create(session, asked.form)
            url = asked.base.replace("http", "ws", 1) + f"poll/{group.number}"
            content = subscription_created(url).encode()
            media_type = XHTML_1.media_type if self.version == 1 else XHTML_2.media_type
            return Reply(201, content=content, media_type=media_type, headers=[("location", url), *session.cookies])
        number = asked.path.removeprefix("/subscription/")
        if asked.method == "DELETE" and number.isdecimal() and self.subscriptions.delete(int(number)):
            return Reply(200 if self.version == 1 else 204)
        raise RwsRefused(NO_RESOURCE)

    def _require_media_types(self, asked: RwsRequest) -> None:
        """RWS 2.0 requires its version in Accept and Content-Type. Raises RwsRefused."""
        if self.world.faults.strike("rws-406"):
            raise RwsRefused(NOT_ACCEPTABLE)
        if self.version == 1:
            return
        content_type = asked.headers.get("content-type", "").replace(" ", "").lower()
        if asked.method == "POST" and content_type != "application/x-www-form-urlencoded;v=2.0":
            raise RwsRefused(UNSUPPORTED_MEDIA)
        accept = asked.headers.get("accept", "*/*").replace(" ", "").lower()
        anything = "*/*" in accept and not (asked.method != "GET" and asked.path.startswith("/fileservice"))
        log = asked.path.startswith("/rw/elog") and "application/hal+json;v=2.1" in accept
        if not (anything or log) and not any(
            wanted.media_type in accept for wanted in (JSON_2, XHTML_2)
        ):  # Accept may list other types beside it
            raise RwsRefused(NOT_ACCEPTABLE)

    def _writing(self, asked: RwsRequest) -> Encoding:
        if self.version == 1:
            return JSON_1 if asked.query.get("json") == "1" else XHTML_1
        return JSON_2 if "hal+json" in asked.headers.get("accept", "").lower() else XHTML_2

    async def _write(
        self, send: Send, writing: Encoding, reply: Reply, asked: RwsRequest, cookies: list[tuple[str, str]]
    ) -> None:
        headers = [*reply.headers, *(cookies if not reply.headers else [])]
        if reply.status == 204:
            await _respond(send, 204, None, b"", headers)
            return
        if reply.content is not None:
            await _respond(send, reply.status, reply.media_type, reply.content, headers)
            return
        content = b"<garbled" if self.world.faults.strike("rws-garbage") else writing.reply(reply, asked).encode()
        await _respond(send, reply.status, writing.media_type, content, headers)

    def _end_session(self, session: Session) -> None:
        self.world.mastership.release_all(session)
        self.subscriptions.end_session(session)
        self.polls.nudge()


def _headers(scope: Scope) -> dict[str, str]:
    return {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}


async def _respond(
    send: Send, status: int, media_type: str | None, content: bytes, headers: list[tuple[str, str]]
) -> None:
    typed = [("content-type", media_type), ("content-length", str(len(content)))] if media_type else []
    raw = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in [*typed, *headers]]
    await send({"type": "http.response.start", "status": status, "headers": raw})
    await send({"type": "http.response.body", "body": content})


# HTTP Digest authentication (RFC 2617, MD5, qop auth), which RWS 1.0 requires.

REALM = "validusers@robapi.abb"
_FIELD = re.compile(r'(\w+)=(?:"([^"]*)"|([^\s,]+))')


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


@dataclass
class DigestAuth:
    """Issued nonces, and the check of responses."""

    passwords: dict[str, str]
    _nonces: set[str] = field(default_factory=set, init=False)

    def challenge(self, domain: str, *, stale: bool = False) -> str:
        """Value of a WWW-Authenticate header."""
        nonce = secrets.token_hex(16)
        self._nonces.add(nonce)
        return (
            f'Digest realm="{REALM}", domain="{domain}", nonce="{nonce}", opaque="799d5", algorithm="MD5", '
            f'qop="auth", stale="{"TRUE" if stale else "FALSE"}"'
        )

    def user(self, authorization: str, method: str) -> str | None:
        """User of a valid response, otherwise None. The uri is hashed as received: clients omit `;value` from it."""
        scheme, _, rest = authorization.partition(" ")
        if scheme.lower() != "digest":
            return None
        said = {name: quoted or plain for name, quoted, plain in _FIELD.findall(rest)}
        user = said.get("username", "")
        if user not in self.passwords or said.get("nonce") not in self._nonces:
            return None
        secret = _md5(f"{user}:{REALM}:{self.passwords[user]}")
        request = _md5(f"{method}:{said.get('uri', '')}")
        middle = ":".join(said.get(name, "") for name in ("nonce", "nc", "cnonce", "qop"))
        right = _md5(f"{secret}:{middle}:{request}") if said.get("qop") else _md5(f"{secret}:{said['nonce']}:{request}")
        return user if secrets.compare_digest(right, said.get("response", "")) else None

    def forget(self) -> None:
        self._nonces.clear()
