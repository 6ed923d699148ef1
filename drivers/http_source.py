"""Content from a URL: limited in size, dated by the response, requested again until it is recent enough.

Whoever answers in the device's place can neither send the daemon elsewhere nor have content unpacked: redirects are
followed at the same host only, and a Content-Encoding is refused, since a few kilobytes unpack to gigabytes.
"""

import asyncio
import math
import ssl
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from email.utils import parsedate_to_datetime

import httpx

from drivers.backoff import Backoff
from drivers.errors import AnswerTooLarge, DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer
from drivers.polled_device import PolledDevice
from drivers.timing import Timing

POLL_S = 5.0
CONNECT_LIMIT_S = 3.0
RETRY_S = 0.05
KEPT_S = 1.0
"""A connection idle for longer is not used again: many servers end theirs after 2 to 5 s, as a picture is asked for."""
HTTP_DATE_STEP_S = 1.0
"""HTTP dates and Age have a resolution of one second: content may be older by that much."""
EXACT_AGE = "x-taken-at-age-s"
TEMPERATURE = "x-camera-temperature-c"
SCALES = "x-scales-by"
"""Header that names the parameter of the query by which the server sends smaller pictures."""
MAX_REDIRECTS = 5
NO_QUERY: Mapping[str, str] = {}
MAX_EXCERPT = 80
"""Characters of a foreign answer that an error shows at most."""


@dataclass(frozen=True)
class Fetched:
    """A response body, its media type without parameters, and the earliest moment the body can stem from.

    `temperature_c`: of the device, by the header X-Camera-Temperature-C; None without it. `scales_by`: by X-Scales-By.
    """

    content: bytes
    media_type: str
    taken_at_s: float
    temperature_c: float | None = None
    scales_by: str | None = None


def excerpt(text: object) -> str:
    """The beginning of what a device, or an error about it, says: printable, at most MAX_EXCERPT characters."""
    return "".join(c if c.isprintable() else "?" for c in str(text)[:MAX_EXCERPT])


def age_s(headers: httpx.Headers) -> float:
    """Age of the content by its headers; 0 without any. Raises ValueError for a malformed header."""
    ages = [0.0]
    if EXACT_AGE in headers:
        ages = [max(float(headers[EXACT_AGE]), 0.0)]  # NaN stays, and is refused
    else:
        if "age" in headers:
            ages.append(float(headers["age"]) + HTTP_DATE_STEP_S)
        if "last-modified" in headers and "date" in headers:
            modified, sent = (parsedate_to_datetime(headers[name]) for name in ("last-modified", "date"))
            ages.append((sent - modified).total_seconds() + HTTP_DATE_STEP_S)
    if not math.isfinite(age := max(ages)):
        raise ValueError(f"{age:g} s")
    return age


def read_temperature_c(headers: httpx.Headers) -> float | None:
    """The device's temperature; None where the header is missing or no finite number."""
    try:
        stated = float(headers[TEMPERATURE])
    except (KeyError, ValueError):
        return None
    return stated if math.isfinite(stated) else None


def tls_trust(url: httpx.URL) -> ssl.SSLContext | bool:
    """httpx's authorities where HTTPS may be spoken, otherwise none: reading them takes 40 ms of processor time.

    From HTTP at a port of its own no redirect to HTTPS is followed.
    """
    plain = url.scheme == "http" and url.port is not None
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT) if plain else True


class HttpSource(PolledDevice):
    """One URL. Between requests a connection attempt every 5 s checks whether the server listens.

    A subclass says how long an answer may take, and how large it may be.
    """

    kind, limit_s, max_bytes = "device", 60.0, 2**30

    def __init__(
        self,
        url: str,
        timing: Timing | None = None,
        *,
        image_size: tuple[int, int] | None = None,
        limit_s: float | None = None,
        max_bytes: int | None = None,
        name: str | None = None,
    ) -> None:
        """`image_size`: of a camera's pictures. What is not given is of the kind of device."""
        self._url, self._image_size = httpx.URL(url), image_size
        shown = self._url.copy_with(userinfo=b"", query=None)
        super().__init__(f"{name or self.kind} {shown}", timing or Timing())
        self._limit_s = limit_s = self.limit_s if limit_s is None else limit_s
        self._max_bytes = self.max_bytes if max_bytes is None else max_bytes
        self._client = httpx.AsyncClient(
            verify=tls_trust(self._url),
            timeout=httpx.Timeout(self._limit_s, connect=CONNECT_LIMIT_S),
            headers={"Accept-Encoding": "identity"},
            limits=httpx.Limits(keepalive_expiry=KEPT_S),
        )

    async def close(self) -> None:
        await super().close()
        await self._client.aclose()

    async def fetch(self, newer_than_s: float, query: Mapping[str, str] = NO_QUERY) -> Fetched:
        """Content from after `newer_than_s`; an unreachable server is tried again until the limit."""
        deadline_s = max(self._timing.clock(), newer_than_s) + self._limit_s
        backoff = Backoff(self._timing.chance)
        error: DeviceError | None = None
        while True:
            wait_s = RETRY_S
            try:
                fetched = await self._within_limit(deadline_s, error, query)
                if fetched.taken_at_s > newer_than_s:
                    return fetched
                late_s = newer_than_s - fetched.taken_at_s
                what = f"the newest content is {late_s:.2f} s older than asked for, after {self._limit_s:g} s"
                error = DeviceTimeout(self.device, what, "check that the device goes on taking pictures")
            except DeviceUnreachable as unreachable:
                error, wait_s = unreachable, backoff.next_wait_s()
            if self._timing.clock() + wait_s >= deadline_s:
                raise error
            await self._timing.sleep(wait_s)

    async def _within_limit(
        self, deadline_s: float, otherwise: DeviceError | None, query: Mapping[str, str]
    ) -> Fetched:
        """One response; on timeout raises `otherwise`, the error of the response before, or DeviceTimeout."""
        asking = asyncio.ensure_future(self._ask(query))
        try:
            in_time = await self._timing.wait_until_done(asking, max(0.0, deadline_s - self._timing.clock()))
        finally:
            if not asking.done():
                asking.cancel()
        if not in_time:
            raise otherwise or self._no_answer()
        return asking.result()

    async def _ask(self, query: Mapping[str, str]) -> Fetched:
        asked_at_s = self._timing.clock()
        try:
            async with self._answer(query) as answer:
                self._raise_for_status(answer)
                if answer.headers.get("content-type", "").strip().lower().startswith("multipart/"):
                    self._report.up("it answers, but with a stream")
                    fix = f"write it as video:{self._url.copy_with(userinfo=b'', query=None)}"
                    raise GarbledAnswer(self.device, "it sends a stream of pictures (multipart), not one", fix)
                content = await self._read_bounded_body(answer)
        except httpx.ConnectTimeout as error:
            raise self._unreachable(f"no connection in {CONNECT_LIMIT_S:g} s") from error
        except httpx.TimeoutException as error:
            raise self._no_answer() from error
        except (httpx.RemoteProtocolError, httpx.DecodingError, httpx.UnsupportedProtocol) as error:
            self._report.up("it answers, but not whole HTTP answers")
            what = f"no whole HTTP answer ({excerpt(error)})"
            raise GarbledAnswer(self.device, what, "check the device and the URL") from error
        except httpx.TransportError as error:
            raise self._unreachable(f"nobody answers ({excerpt(error) or type(error).__name__})") from error
        try:
            taken_at_s = asked_at_s - age_s(answer.headers)
        except (ValueError, TypeError) as error:
            what = f"an age that cannot be read ({excerpt(error)})"
            raise GarbledAnswer(
                self.device, what, "correct the server's Age, Last-Modified or X-Taken-At-Age-S"
            ) from error
        self._report.up("it answers")
        media_type = excerpt(answer.headers.get("content-type", "").partition(";")[0].strip().lower())
        return Fetched(content, media_type, taken_at_s, read_temperature_c(answer.headers), answer.headers.get(SCALES))

    @asynccontextmanager
    async def _answer(self, query: Mapping[str, str]) -> AsyncIterator[httpx.Response]:
        """The answer to a GET, its body unread, after at most MAX_REDIRECTS redirects."""
        request = self._client.build_request("GET", self._url.copy_merge_params(query))
        for _ in range(1 + MAX_REDIRECTS):
            answer = await self._client.send(request, stream=True)
            try:
                if answer.next_request is None:
                    yield answer
                    return
            finally:
                await answer.aclose()
            self._require_same_server(answer.next_request.url)
            request = answer.next_request
        raise GarbledAnswer(self.device, f"more than {MAX_REDIRECTS} redirects", "give the final URL in the settings")

    def _require_same_server(self, url: httpx.URL) -> None:
        """Only this host and port, and from HTTP to HTTPS at their usual ports."""
        asked, given = ((each.scheme, each.host, each.port) for each in (self._url, url))
        if given not in (asked, ("https", asked[1], None) if asked[2] is None else asked):
            what = f"it redirects to {excerpt(url.copy_with(userinfo=b'', path='/', query=None, fragment=None))}"
            self._report.up(what)
            raise GarbledAnswer(self.device, what, "give the address that is meant in the settings")

    async def _read_bounded_body(self, answer: httpx.Response) -> bytes:
        encoding = answer.headers.get("content-encoding", "identity").strip().lower()
        if encoding not in ("identity", ""):
            self._report.up("it answers, but packed")
            what = f"the answer is packed (Content-Encoding: {excerpt(encoding)})"
            raise GarbledAnswer(self.device, what, "let the server send it as it is, as it was asked to")
        content = bytearray()
        async for chunk in answer.aiter_raw():
            content += chunk
            if len(content) > self._max_bytes:
                what = f"more than {self._max_bytes} bytes came"
                raise AnswerTooLarge(self.device, what, "raise the limit in the settings, or send less")
        if not content:
            raise GarbledAnswer(self.device, "the answer is empty", "check the device and the URL")
        return bytes(content)

    def _raise_for_status(self, answer: httpx.Response) -> None:
        if answer.status_code == 200:
            return
        what = f"it answered {answer.status_code} {excerpt(answer.reason_phrase)}"
        self._report.up(what)
        if answer.status_code >= 500:
            raise DeviceUnreachable(self.device, what, "the device is not ready; look at it")
        raise GarbledAnswer(self.device, what, "check the URL, and user and password in it")

    def _unreachable(self, what: str) -> DeviceUnreachable:
        self._report.down(what)
        return DeviceUnreachable(self.device, what, "check that the device is on, the address and the port")

    def _no_answer(self) -> DeviceTimeout:
        what = f"no answer in {self._limit_s:g} s"
        self._report.down(what)
        return DeviceTimeout(self.device, what, "check that the device is on and not busy")

    async def _look(self) -> None:
        backoff = Backoff(self._timing.chance)
        while True:
            try:
                async with asyncio.timeout(CONNECT_LIMIT_S):
                    port = self._url.port or {"http": 80, "https": 443}[self._url.scheme]
                    _, writer = await asyncio.open_connection(self._url.host, port)
                writer.close()
            except (OSError, TimeoutError) as error:
                self._report.down(f"nobody listens ({error or 'no answer'})")
                await self._timing.sleep(backoff.next_wait_s())
            else:
                if not self.link.connected:
                    self._report.up("somebody listens")
                backoff.reset()
                await self._timing.sleep(POLL_S)
