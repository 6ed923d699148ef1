"""Checks of every request: body size, host, origin; its id and counters. Plain ASGI, so that bodies are streamed."""

import re
import secrets
import socket

from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calibration.errors import DocumentProblem
from daemon.api.http_errors import (
    BodyTooLarge,
    CrossOrigin,
    HostNotAllowed,
    InvalidRequest,
    RequestMalformed,
    UnknownMediaType,
)
from daemon.api.problems import answer, problem_of
from daemon.config.server_settings import ServerSettings
from daemon.http.security_headers import with_security_headers
from daemon.runtime.logs import about_request
from daemon.runtime.metrics import Metrics

MAX_JSON_BYTES = 1_000_000
"""1 MB; a hundred poses are 20 kB."""

MAX_SETUP_BYTES = 1_000
"""Of POST /setup and /session, which need no key: a code and a name, or a key."""

MAX_QUERY_BYTES = 4_096
"""A pose of seven numbers is 150."""

CLOUD_PATHS = ("/register", "/scans/")
HOST = re.compile(
    r"(?:(?P<address>[0-9]{1,3}(?:\.[0-9]{1,3}){3}|\[[0-9A-Fa-f:.]+\])|(?P<name>[A-Za-z0-9._-]+))(?::[0-9]{1,5})?"
)
SINGLE_HEADERS = frozenset({
    b"host", b"origin", b"authorization", b"content-type", b"content-length", b"content-encoding",
    b"sec-fetch-site", b"sec-fetch-mode", b"sec-fetch-dest", b"last-event-id",
})  # fmt: skip
"""Refused when repeated (RFC 9112, 3.2): whoever looks at them before us might look at the other one."""

REQUEST_ID = re.compile(r"[A-Za-z0-9._:-]{1,64}")

LINKED_PATHS = re.compile(
    r"/(?:health|page/.*|docs/.*|openapi\.json|calibrations/current|(?:runs|calibrations|scans)(?:/[^/]+)?)?"
)
"""Documents that a link on a page of another origin may lead to: read from the store, without work for a device."""

REFUSALS = (BodyTooLarge, CrossOrigin, HostNotAllowed, InvalidRequest, RequestMalformed, UnknownMediaType)


METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
"""Those that metrics name."""


class RequestChecks:
    """Refuses bodies over the limit, other hosts and other origins; counts every answer."""

    def __init__(self, app: ASGIApp, server: ServerSettings, metrics: Metrics) -> None:
        self._app, self._cloud_limit, self._metrics = app, int(server.body_limit_mb * 1_000_000), metrics
        own = ("localhost", socket.gethostname(), socket.getfqdn(), server.host, *server.allowed_hosts)
        self._hosts = frozenset(name.lower() for name in own)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
        request_id = _request_id(headers)
        exchange = _Exchange(receive, send, self._limit(scope["path"]), request_id, scope["method"])
        try:
            with about_request(request_id):
                await self._pass(scope, exchange, headers)
        finally:
            exchange.close()

    async def _pass(self, scope: Scope, exchange: "_Exchange", headers: dict[bytes, str]) -> None:
        answered = True
        try:
            names = [name for name, _ in scope["headers"] if name in SINGLE_HEADERS]
            if len(names) > len(set(names)):
                raise RequestMalformed(next(name.decode() for name in names if names.count(name) > 1))
            exchange.check_length(headers.get(b"content-length", ""))
            self._check_host(scope["http_version"], headers)
            _check_origin(scope, headers)
            encoding = headers.get(b"content-encoding", "identity")  # bodies are taken as they come, never unpacked
            if encoding.strip().lower() != "identity":
                what = f"the body's encoding {encoding[:40]!r} is not supported"
                raise UnknownMediaType(what, "send the body as it is")
            if (size := len(scope["query_string"])) > MAX_QUERY_BYTES:
                fix = f"send at most {MAX_QUERY_BYTES} bytes after the question mark"
                raise InvalidRequest([DocumentProblem("query", f"it has {size} bytes", fix)])
            asked = {**scope, "method": "GET"} if scope["method"] == "HEAD" else scope
            await self._app(asked, exchange.receive, exchange.send)
        except ClientDisconnect:
            answered = exchange.cut
        except REFUSALS as error:
            if exchange.status is not None:
                raise
            await answer(problem_of(error), {"Connection": "close"})(scope, exchange.receive, exchange.send)
        finally:
            if answered:
                method = scope["method"] if scope["method"] in METHODS else "other"
                self._metrics.requests[method, exchange.status or 500] += 1

    def _check_host(self, http_version: str, headers: dict[bytes, str]) -> None:
        """Refuse host names that are not in the settings (DNS rebinding); addresses are allowed."""
        host = headers.get(b"host")
        if host is None and http_version == "1.0":
            return
        name = HOST.fullmatch(host or "")
        if name is None or not (name["address"] or name["name"].lower() in self._hosts):
            raise HostNotAllowed(host or "")

    def _limit(self, path: str) -> int:
        if path.startswith(CLOUD_PATHS):
            return self._cloud_limit
        return MAX_SETUP_BYTES if path in ("/setup", "/session") else MAX_JSON_BYTES


class _Exchange:
    """One request and its answer, with the size of the body and the status; `cut`: it is HEAD's, and without a body."""

    def __init__(self, receive: Receive, send: Send, limit_bytes: int, request_id: str, method: str) -> None:
        self._receive, self._send, self._limit = receive, send, limit_bytes
        self._request_id, self._is_head = request_id.encode(), method == "HEAD"
        self._received, self.cut = 0, False
        self.status: int | None = None

    def check_length(self, content_length: str) -> None:
        if content_length.isdigit() and int(content_length) > self._limit:
            raise BodyTooLarge(self._limit)

    async def receive(self) -> Message:
        message = await self._receive()
        self._received += len(message.get("body", b""))
        if self._received > self._limit:
            raise BodyTooLarge(self._limit)
        return message

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            headers = [*message.get("headers", ()), (b"x-request-id", self._request_id)]
            message = {**message, "headers": with_security_headers(headers)}
        elif self.cut:
            return
        elif self._is_head:  # the server then reports a disconnect, which ends the work for what is not sent
            self.cut, message = True, {"type": "http.response.body"}
        await self._send(message)

    def close(self) -> None:
        """Let go of the server's request, which refers to this one: with its connection it is then freed at once."""
        self._receive, self._send = _receive_nothing, _send_nowhere


async def _receive_nothing() -> Message:
    return {"type": "http.disconnect"}


async def _send_nowhere(_message: Message) -> None: ...


def _check_origin(scope: Scope, headers: dict[bytes, str]) -> None:
    """Refuse requests of browser pages from other origins (Fetch standard, Origin and Sec-Fetch-*).

    Allowed is a link that is followed in a window of its own, to a document of LINKED_PATHS.
    """
    host, foreign = headers.get(b"host", "").lower(), ""
    for name, value in scope["headers"]:
        given = value.decode("latin-1").lower()
        if name == b"origin" and not (host and given in (f"http://{host}", f"https://{host}")):
            foreign = given
        if name == b"sec-fetch-site" and given not in ("same-origin", "none") and not _follows_link(scope, headers):
            foreign = foreign or f"another site ({given[:20]})"
    if foreign:
        raise CrossOrigin(f"a page of {foreign[:80]!r} asks", "ask from a page of this daemon, or with curl")


def _follows_link(scope: Scope, headers: dict[bytes, str]) -> bool:
    """True for a navigation of a whole window to a document of LINKED_PATHS."""
    navigates = (headers.get(b"sec-fetch-mode"), headers.get(b"sec-fetch-dest")) == ("navigate", "document")
    return navigates and scope["method"] == "GET" and LINKED_PATHS.fullmatch(scope["path"]) is not None


def _request_id(headers: dict[bytes, str]) -> str:
    """The caller's X-Request-Id when it is safe to log, else a new one."""
    given = headers.get(b"x-request-id", "")
    return given if REQUEST_ID.fullmatch(given) else secrets.token_hex(4)
