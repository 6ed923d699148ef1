"""What every request passes before it reaches a route: size, origin, counting. Plain ASGI, so that bodies stream."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from daemon.api.problems import answer, problem_of
from daemon.errors import BodyTooLarge, CrossOrigin
from daemon.metrics import Metrics

JSON_LIMIT_BYTES = 1_000_000
"""A hundred poses are 20 kB."""

CLOUD_PATHS = ("/register", "/scans/")
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


class Guards:
    """Refuses a body over its limit before it is read, and a foreign page's request; counts every answer."""

    def __init__(self, app: ASGIApp, cloud_limit_bytes: int, metrics: Metrics) -> None:
        self._app, self._cloud_limit, self._metrics = app, cloud_limit_bytes, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        exchange = _Exchange(receive, send, self._limit(scope["path"]))
        headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
        try:
            exchange.require_length(headers.get(b"content-length", ""))
            _require_own_origin(scope["method"], headers)
            await self._app(scope, exchange.receive, exchange.send)
        except (BodyTooLarge, CrossOrigin) as error:
            if exchange.status is not None:
                raise
            await answer(problem_of(error), {"Connection": "close"})(scope, receive, exchange.send)
        finally:
            self._metrics.requests[_method(scope["method"]), exchange.status or 500] += 1

    def _limit(self, path: str) -> int:
        return self._cloud_limit if path.startswith(CLOUD_PATHS) else JSON_LIMIT_BYTES


class _Exchange:
    """One request and its answer, counted."""

    def __init__(self, receive: Receive, send: Send, limit_bytes: int) -> None:
        self._receive, self._send, self._limit = receive, send, limit_bytes
        self._received = 0
        self.status: int | None = None

    def require_length(self, content_length: str) -> None:
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
        await self._send(message)


def _require_own_origin(method: str, headers: dict[bytes, str]) -> None:
    """A browser names the page that asks; a page from elsewhere must not move the robot."""
    origin, host = headers.get(b"origin"), headers.get(b"host", "")
    if method not in SAFE_METHODS and origin is not None and origin.partition("://")[2] != host:
        raise CrossOrigin(f"a page of {origin[:80]!r} asks", "ask from a page of this daemon, or with curl")


def _method(method: str) -> str:
    """A caller's invention must not become a label of its own."""
    return method if method in {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"} else "other"
