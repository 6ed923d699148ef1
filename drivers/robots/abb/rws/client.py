"""HTTP client of a controller: detects the version, keeps one session, limits the request rate, maps errors."""

import asyncio
import json
import ssl
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import httpx

from drivers.errors import DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer, LinkLost, RequestRefused
from drivers.robots.abb.rws.address import SCHEMES, RwsAddress
from drivers.robots.abb.rws.dialect import DIALECTS, Dialect, error_in
from drivers.timing import Timing

REFUSALS: dict[str, list[str]] = json.loads(Path(__file__).with_name("refusals.json").read_text("utf-8"))
"""Name, what and fix by the controller's code, and by the HTTP status where it gives none that is known."""


class ControllerBusy(DeviceUnreachable):
    """Status 503: the controller has no session or turn left, and did nothing of what was asked."""


TOO_MANY = "its 70 sessions are taken, or it is asked more than 20 times a second"


def error_of_response(device: str, doing: str, status: int, code: int | None, message: str) -> DeviceError:
    """The error for a response with that HTTP status."""
    if status == 503:
        return ControllerBusy(device, f"{doing}: it answers 503, {TOO_MANY}", "close other clients of its web services")
    if status >= 500:
        return DeviceUnreachable(
            device, f"{doing}: it answers {status}", "look at the controller; restart it if it stays"
        )
    row = (REFUSALS.get(str(code)) if status in (400, 403, 404) else None) or REFUSALS.get(str(status))
    if row is None:
        what = f"{doing}: it answers {status}"
        return GarbledAnswer(device, what, "check that Robot Web Services listen at this address")
    name, what, fix = row
    said = f" ({message or code})" if code else ""
    return RequestRefused(device, f"{doing} was refused, {what}{said}", fix, name)


LIMIT_S, CONNECT_LIMIT_S = 5.0, 3.0
CONNECTIONS, URGENT_CONNECTIONS = 4, 1
"""Connections to the controller, and how many of them only urgent requests use: a controller that answers late does
not hold up a stop.
"""
REQUESTS_PER_S, BURST = 15.0, 8.0
"""Below the controllers' limit of 20 requests per second, which all clients share."""
BUSY_WAITS_S = (0.5, 1.5)
"""Before a request that is not urgent is sent again to a controller that was busy."""
MAX_PAGES = 100
"""Of one list: ten thousand signals. A controller that names one page after another without an end is garbled."""
AT_CONTROLLER = "check that the address is a controller's"
LISTENS = "check the address; on the controller: option PC Interface, the network port, the firewall"


class RwsClient:
    """One session. `dialect` is None until the controller was found."""

    def __init__(self, device: str, address: RwsAddress, timing: Timing, limit_s: float = LIMIT_S) -> None:
        self.device, self.address = device, address
        self._timing, self._limit_s = timing, limit_s
        self.dialect: Dialect | None = None
        self._http: httpx.AsyncClient | None = None
        self._finding = asyncio.Lock()
        self._tokens, self._counted_s = BURST, timing.clock()
        self._ordinary = asyncio.Semaphore(CONNECTIONS - URGENT_CONNECTIONS)

    async def find(self) -> Dialect:
        """The session's dialect; without one, tries 2.0 over HTTPS, then 1.0 over HTTP. Raises DeviceError."""
        async with self._finding:
            return self.dialect or await self._open()

    async def _open(self) -> Dialect:
        errors: list[DeviceError] = []
        for version in [self.address.version] if self.address.version else SCHEMES:
            http = self._session(version)
            try:
                dialect = DIALECTS[version]
                await self._send(
                    http, "GET", dialect.controller_state, dialect.query, {}, dialect.headers, "the greeting"
                )
            except DeviceError as error:
                await http.aclose()
                errors.append(error)
                if isinstance(error, RequestRefused) and error.status == "UNAUTHORIZED":
                    break  # found, but refused: this password is not tried elsewhere
            except BaseException:
                await http.aclose()
                raise
            else:
                self._http, self.dialect = http, dialect
                return dialect
        raise self._most_specific(errors)

    async def get(
        self, path: str, query: Mapping[str, str] | None = None, *, urgent: bool = False
    ) -> list[dict[str, Any]]:
        """Resources at a path, of all pages of a list; `urgent` skips the rate limit. Raises DeviceError."""
        dialect, found = self.require_dialect(), list[dict[str, Any]]()
        asked = {**(query or {}), **dialect.query}
        for _ in range(MAX_PAGES):
            page, following = await self._get(path, asked, dialect.headers, urgent=urgent)
            found += page
            if not following:
                return found
            asked |= following
        raise GarbledAnswer(self.device, f"reading {path}: more than {MAX_PAGES} pages", AT_CONTROLLER)

    async def get_event_log(self) -> list[dict[str, Any]]:
        """Newest entries of the common event log, newest first. Raises DeviceError."""
        dialect = self.require_dialect()
        return (await self._get("/rw/elog/0", dialect.log_query, dialect.log_headers))[0]

    async def _get(
        self, path: str, query: Mapping[str, str], headers: Mapping[str, str], *, urgent: bool = False
    ) -> tuple[list[dict[str, Any]], dict[str, str]]:
        dialect = self.require_dialect()
        answer = await self.ask("GET", path, query, headers=headers, urgent=urgent)
        try:
            return dialect.page(answer.content)
        except ValueError as error:
            what = f"reading {path}: no answer of {dialect.name} ({error})"
            raise GarbledAnswer(self.device, what, AT_CONTROLLER) from error

    async def post(
        self, path: str, query: Mapping[str, str], form: Mapping[str, str], *, urgent: bool = False
    ) -> httpx.Response:
        """Post a form; `urgent` skips the rate limit. Raises DeviceError."""
        headers = self.require_dialect().post_headers
        return await self.ask("POST", path, query, form=form, headers=headers, urgent=urgent)

    async def get_file(self, path: str) -> bytes | None:
        """Content of a file below the controller's home folder; None when there is none. Raises DeviceError."""
        dialect = self.require_dialect()
        try:
            answer = await self.ask("GET", f"/fileservice/{dialect.home}/{path}", headers={"Accept": "*/*"})
        except RequestRefused as refused:
            if refused.status == "NOT_FOUND":
                return None
            raise
        return answer.content

    async def delete(self, path: str) -> None:
        """Raises DeviceError."""
        await self.ask("DELETE", path, headers=self.require_dialect().post_headers)

    async def ask(
        self,
        method: str,
        path: str,
        query: Mapping[str, str] | None = None,
        *,
        headers: Mapping[str, str],
        form: Mapping[str, str] | None = None,
        content: bytes | None = None,
        urgent: bool = False,
    ) -> httpx.Response:
        """The answer to one request; `urgent` skips the rate limit. Raises DeviceError."""
        if not urgent:
            await self._pace()
        async with nullcontext() if urgent else self._ordinary:
            doing, waits_s = f"{method} {path}", iter(() if urgent else BUSY_WAITS_S)
            while True:
                self.require_dialect()
                assert self._http is not None
                try:
                    return await self._send(self._http, method, path, query or {}, form, headers, doing, content)
                except ControllerBusy:
                    if (wait_s := next(waits_s, None)) is None:
                        raise
                await self._timing.sleep(wait_s)

    async def close(self) -> None:
        """Log out, to free the controller's session."""
        http, self._http, self.dialect = self._http, None, None
        if http is None:
            return
        try:
            async with asyncio.timeout(1.0):
                await http.get("/logout", headers={"Accept": "*/*"})
        except (httpx.HTTPError, TimeoutError):
            pass  # unreachable: the session expires in five minutes
        finally:
            await http.aclose()

    def socket(self, path: str) -> tuple[str, dict[str, str], ssl.SSLContext | None]:
        """URL, headers and TLS context of a subscription's WebSocket."""
        http, dialect = self._http, self.require_dialect()
        assert http is not None
        cookies = "; ".join(f"{name}={value}" for name, value in http.cookies.items())
        url = self.address.url(dialect.version).replace("http", "ws", 1) + path
        return url, {"Cookie": cookies}, self._tls() if dialect.version == 2 else None

    # --- inside ---

    def require_dialect(self) -> Dialect:
        """The session's dialect; raises DeviceUnreachable without a session."""
        if self.dialect is None:
            raise DeviceUnreachable(self.device, "no session with the controller", "it is looked for again by itself")
        return self.dialect

    def _most_specific(self, errors: list[DeviceError]) -> DeviceError:
        """From one error per version tried, the one that was answered, or all combined."""
        for error in errors:
            if not isinstance(error.__cause__, httpx.TransportError) or len(errors) == 1:
                return error
        tried = "; ".join(
            f"{SCHEMES[version].upper()}: {error.what}" for version, error in zip(SCHEMES, errors, strict=True)
        )
        return DeviceUnreachable(self.device, tried, LISTENS)

    def _session(self, version: int) -> httpx.AsyncClient:
        secret = self.address.secret(self.device)
        auth: httpx.Auth = httpx.BasicAuth(self.address.user, secret)
        if version == 1:
            auth = httpx.DigestAuth(self.address.user, secret)
        return httpx.AsyncClient(
            base_url=self.address.url(version),
            auth=auth,
            verify=self._tls() if version == 2 else ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT),  # RWS 1.0 is plain HTTP
            timeout=httpx.Timeout(self._limit_s, connect=CONNECT_LIMIT_S),
            trust_env=False,
            limits=httpx.Limits(max_connections=CONNECTIONS),
        )

    def _tls(self) -> ssl.SSLContext:
        """TLS context: controllers sign their own certificates, so a given one is trusted alone, otherwise any."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        if self.address.certificate is not None:
            context.verify_mode = ssl.CERT_REQUIRED
            try:
                context.load_verify_locations(self.address.certificate)
            except (OSError, ssl.SSLError) as error:
                what = f"the certificate {self.address.certificate} cannot be read ({error})"
                raise RequestRefused(
                    self.device, what, "correct certificate in the address", "NO_CERTIFICATE"
                ) from error
        return context

    async def _pace(self) -> None:
        """Delay, so that the request rate stays below the controllers' limit."""
        now_s = self._timing.clock()
        self._tokens = min(BURST, self._tokens + (now_s - self._counted_s) * REQUESTS_PER_S) - 1.0
        self._counted_s = now_s
        if self._tokens < 0:
            try:
                await self._timing.sleep(-self._tokens / REQUESTS_PER_S)
            except asyncio.CancelledError:
                self._tokens += 1.0  # nothing was sent: those behind it wait less
                raise

    async def _send(
        self,
        http: httpx.AsyncClient,
        method: str,
        path: str,
        query: Mapping[str, str],
        form: Mapping[str, str] | None,
        headers: Mapping[str, str],
        doing: str,
        content: bytes | None = None,
    ) -> httpx.Response:
        body = {"data": dict(form)} if form else {"content": content} if content is not None else {}
        try:
            answer = await http.request(method, path, params=dict(query), headers=dict(headers), **body)
        except httpx.ConnectTimeout as error:
            raise DeviceUnreachable(self.device, f"no connection in {CONNECT_LIMIT_S:g} s", LISTENS) from error
        except httpx.TimeoutException as error:
            raise DeviceTimeout(self.device, f"{doing}: no answer in {self._limit_s:g} s", LISTENS) from error
        except httpx.ConnectError as error:
            raise DeviceUnreachable(self.device, f"nobody answers ({error})", LISTENS) from error
        except httpx.TransportError as error:
            what = f"{doing}: the connection broke ({error or type(error).__name__})"
            raise LinkLost(self.device, what, "it is opened again by itself") from error
        if answer.is_success:
            return answer
        raise error_of_response(self.device, doing, answer.status_code, *error_in(answer.content))
