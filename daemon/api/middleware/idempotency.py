"""Idempotency-Key on every POST: a repeated request receives the first answer and has no further effect. One that
started a run receives that run as it is now, and waits for its end as long as the repetition's own `wait` says.

After the IETF draft "The Idempotency-Key HTTP Header Field" (draft-ietf-httpapi-idempotency-key-header). An error that
had no effect is not stored, so the same request can be repeated when its cause is corrected.
"""

import hashlib
import json
import logging
import re
from dataclasses import replace
from urllib.parse import parse_qsl, urlencode

from pydantic import RootModel, TypeAdapter, ValidationError
from starlette.requests import ClientDisconnect, Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calibration.errors import DocumentProblem
from daemon.api.dependencies import Wait
from daemon.api.extension import Extensions, Rebuild, Rebuilt, rebuilt_of
from daemon.api.http_errors import InvalidRequest, KeyReused, RequestInFlight
from daemon.api.middleware.disconnects import wait_for_run
from daemon.api.problems import answer, problem_of
from daemon.api.run_answers import answer_started
from daemon.api.schemas.scans import ScanDocument
from daemon.api.streaming.request_body import body_chunks
from daemon.application import Application
from daemon.errors import DaemonError, StorageError
from daemon.http.connections import TAKE_SOCKET
from daemon.model.records import AppliedCalibration, ScanViewDocument
from daemon.store.actor import AuditContext, IdempotentRequest, acting_as, current_audit_context
from daemon.store.idempotency_keys import StoredRequest


async def rebuild_answer(app: Application, effect: str, added: Extensions = ()) -> Rebuilt:
    """The answer from the stored effect, such as "scan ID"; not of a run. Raises NotFound, StorageError."""
    kind, _, subject = effect.partition(" ")
    rebuilders = _REBUILDERS | {noun: how for extension in added for noun, how in extension.rebuilders.items()}
    return await rebuilders[kind](app, subject)


async def _scan(app: Application, scan_id: str) -> Rebuilt:
    scan = await app.store.scan(scan_id)
    return rebuilt_of(
        201, RootModel[ScanDocument](ScanDocument.of(scan, await app.store.scan_views(scan_id))), f"/scans/{scan_id}"
    )


async def _view(app: Application, subject: str) -> Rebuilt:
    scan_id, _, number = subject.partition(" ")
    view = (await app.store.scan_views(scan_id))[int(number)]
    return rebuilt_of(201, RootModel[ScanViewDocument](view), f"/scans/{scan_id}")


async def _apply(app: Application, sequence: str) -> Rebuilt:
    applied = await app.store.history_entry(int(sequence))
    return rebuilt_of(200, RootModel[AppliedCalibration](applied), "/calibrations/current")


async def _acceptance(app: Application, acceptance_id: str) -> Rebuilt:
    stored = await app.store.acceptances.get(acceptance_id)
    headers = {"content-type": "application/json", "location": f"/acceptances/{acceptance_id}"}
    return 200, headers, stored.document.encode()


_REBUILDERS: dict[str, Rebuild] = {
    "scan": _scan,
    "view": _view,
    "apply": _apply,
    "acceptance": _acceptance,
}


log = logging.getLogger(__name__)

HEADER = b"idempotency-key"
MAX_KEY_LENGTH = 255
KEY_PATTERN = re.compile(rf'([!#-~]{{1,{MAX_KEY_LENGTH}}}|"[!#-~]{{1,{MAX_KEY_LENGTH}}}")')
REPLAYED = "Idempotency-Replayed"
KEPT_HEADERS = frozenset({"content-type", "location", "etag", "link", "vary", "handeyed-calibration", "handeyed-pose"})
STREAMED_PATHS = ("/register",)
"""Paths whose answers are too large to store: their inputs are stored, and the answer is computed again."""


NOT_STORED = re.compile(r"/setup|/session(?:/.*)?|/keys(?:/.*)?|/support-bundle")
"""Paths whose answers hold a key, a cookie or a code in clear text, or megabytes, and are not stored."""


class Idempotency:
    """Stores requests and answers by caller and key, and replays them."""

    def __init__(self, app: ASGIApp, application: Application, added: Extensions = ()) -> None:
        self._app, self._application, self._added = app, application, added
        self._in_flight: set[tuple[str, str]] = set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        given = [value for name, value in scope["headers"] if name == HEADER]
        if scope["method"] != "POST" or not given or NOT_STORED.fullmatch(scope["path"]):
            await self._app(scope, receive, send)
            return
        try:
            await self._process(scope, receive, send, key_of(given))
        except DaemonError as error:
            await answer(problem_of(error), {"Connection": "close"})(scope, receive, send)

    async def _process(self, scope: Scope, receive: Receive, send: Send, key: str) -> None:
        context = current_audit_context()
        caller, head = context.caller, head_of(scope)
        store = self._application.store.idempotency_keys
        if (caller, key) in self._in_flight:
            effect = await store.effect(caller, key) or ""
            raise RequestInFlight(effect.removeprefix("run ") if effect.startswith("run ") else None)
        self._in_flight.add((caller, key))
        scope["state"].pop(TAKE_SOCKET, None)  # a thread would read past the digest
        try:
            earlier = await store.begin(caller, key, head, self._application.clock.timestamp())
            if earlier is None:
                await self._process_first(
                    scope, receive, send, replace(context, request=IdempotentRequest(caller, key))
                )
            elif earlier.head != head:
                raise KeyReused
            elif scope["path"] in STREAMED_PATHS:
                await self._process_again(scope, receive, send, earlier)
            else:
                await self._replay(scope, receive, send, earlier)
        finally:
            self._in_flight.discard((caller, key))

    async def _process_first(self, scope: Scope, receive: Receive, send: Send, context: AuditContext) -> None:
        """Process a new request; the answer is sent only once it is stored."""
        assert context.request is not None
        request, reply = context.request, _Reply(send, held=scope["path"] not in STREAMED_PATHS)
        try:
            with acting_as(context):
                await self._app(scope, _hashing(receive, request.digest), reply.send)
        finally:
            await self._remember(request, reply)
        await reply.release()

    async def _remember(self, request: IdempotentRequest, reply: "_Reply") -> None:
        store = self._application.store.idempotency_keys
        try:
            if reply.complete and (reply.status < 400 or request.had_effect):
                content = bytes(reply.content) if reply.held else None
                body = request.digest.hexdigest()
                await store.save_answer(request.caller, request.key, body, reply.status, reply.kept_headers, content)
            elif not request.had_effect:
                await store.forget(request.caller, request.key)
        except StorageError as error:  # the effect is stored; the answer can be rebuilt from it
            log.error("the answer to a request with an Idempotency-Key could not be kept: %s", error)

    async def _replay(self, scope: Scope, receive: Receive, send: Send, earlier: StoredRequest) -> None:
        try:
            async for _ in body_chunks(_hashing(receive, hashlib.sha256(), earlier.body)):
                pass
        except ClientDisconnect:
            return
        if (effect := earlier.effect or "").startswith("run "):
            request = Request(scope, receive)
            run = await wait_for_run(request, self._application, effect.removeprefix("run "), wait_of(request))
            response = await answer_started(request, self._application, run)
            response.headers[REPLAYED] = "true"
            await response(scope, receive, send)
            return
        if earlier.status is None:
            assert earlier.effect is not None
            reply = await rebuild_answer(self._application, earlier.effect, self._added)
        else:
            reply = earlier.status, earlier.headers, earlier.content or b""
        status, headers, content = reply
        sent = {**headers, REPLAYED: "true", "content-length": str(len(content))}
        pairs = [(name.lower().encode(), value.encode("latin-1")) for name, value in sent.items()]
        await send({"type": "http.response.start", "status": status, "headers": pairs})
        await send({"type": "http.response.body", "body": content})

    async def _process_again(self, scope: Scope, receive: Receive, send: Send, earlier: StoredRequest) -> None:
        """Process a repeated cloud with the calibration and the pose of the first request."""
        query = dict(parse_qsl(scope["query_string"].decode("latin-1")))
        query["calibration"] = earlier.headers["handeyed-calibration"]
        query["pose"] = earlier.headers["handeyed-pose"]
        scope = {**scope, "query_string": urlencode(query).encode()}

        async def send_with_mark(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message["headers"], (REPLAYED.lower().encode(), b"true")]}
            await send(message)

        await self._app(scope, _hashing(receive, hashlib.sha256(), earlier.body), send_with_mark)


def _hashing(receive: Receive, digest: "hashlib._Hash", expected: str | None = None) -> Receive:
    """As `receive`, with the body added to the digest. Raises KeyReused at the end of another body than expected."""

    async def receive_and_hash() -> Message:
        message = await receive()
        digest.update(message.get("body", b""))
        ended = message["type"] == "http.request" and not message.get("more_body", False)
        if ended and expected is not None and digest.hexdigest() != expected:
            raise KeyReused
        return message

    return receive_and_hash


class _Reply:
    """An answer in progress; with `held` it is sent when `release` is called."""

    def __init__(self, send: Send, held: bool) -> None:
        self._send, self.held = send, held
        self._messages: list[Message] = []
        self.status = 0
        self.kept_headers: dict[str, str] = {}
        self.content = bytearray()
        self.complete = False

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            headers = ((name.decode().lower(), value.decode("latin-1")) for name, value in message["headers"])
            self.kept_headers = {name: value for name, value in headers if name in KEPT_HEADERS}
        elif message["type"] == "http.response.body":
            self.complete = not message.get("more_body", False)
            if self.held:
                self.content += message.get("body", b"")
        if self.held:
            self._messages.append(message)
        else:
            await self._send(message)

    async def release(self) -> None:
        for message in self._messages:
            await self._send(message)


def key_of(given: list[bytes]) -> str:
    """The header's value, with or without the quotes of a structured field. Raises InvalidRequest."""
    key = KEY_PATTERN.fullmatch(given[0].decode("latin-1"))
    if len(given) != 1 or key is None:
        fix = f"send one, of 1 to {MAX_KEY_LENGTH} visible ASCII characters, such as a UUID"
        raise InvalidRequest([DocumentProblem("header.Idempotency-Key", "not one usable key", fix)])
    return key[1].strip('"')


def wait_of(request: Request) -> float:
    """The query's `wait` in s. Raises InvalidRequest."""
    given = request.query_params.get("wait", "0")
    try:
        return float(TypeAdapter(Wait).validate_python(given))
    except ValidationError:
        problem = DocumentProblem("query.wait", f"{given[:20]!r} is no number of seconds", "give 0 to 3600")
        raise InvalidRequest([problem]) from None


def head_of(scope: Scope) -> str:
    """SHA-256 over method, path, query without `wait`, and media type."""
    query = sorted(pair for pair in parse_qsl(scope["query_string"].decode("latin-1"), True) if pair[0] != "wait")
    media_type = dict(scope["headers"]).get(b"content-type", b"").decode("latin-1").partition(";")[0].strip().lower()
    asked = [scope["method"], scope["path"], query, media_type]
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()
