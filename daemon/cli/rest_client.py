"""Client of the daemon's REST interface for commands; raises CommandError."""

import json
import os
import signal
import ssl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from daemon.cli.errors import CommandError, ExitStatus
from daemon.cli.service import pinned, running_service
from daemon.model.run_states import FINAL_STATES

DEFAULT_URL = "http://127.0.0.1:8372"
MAX_ANSWER_S = 30.0
"""Only runs take longer, and they are followed through their events."""

ServerEvent = dict[str, Any]


class NoDaemon(CommandError):
    """Nothing listens at the address."""


class DaemonClient:
    """One daemon at one address. Every method raises CommandError.

    The environment variable HANDEYED_KEY holds the API key, HANDEYED_CA the authority of its certificate. Root and the
    service's group need neither for the service of this machine, which DEFAULT_URL means wherever it listens.
    """

    def __init__(self, url: str, limit_s: float = MAX_ANSWER_S, trust: ssl.SSLContext | None = None) -> None:
        """`trust`: TLS in place of HANDEYED_CA and the system's authorities."""
        service = running_service()
        if service is not None and url == DEFAULT_URL:
            url = service.url
        self.url = url.rstrip("/")
        ours = service if service is not None and service.is_at(self.url) else None
        key, authority = os.environ.get("HANDEYED_KEY"), os.environ.get("HANDEYED_CA")
        authorization = f"Bearer {key}" if key else None if ours is None else ours.authorization
        if trust is None and authority:
            trust = _tls_context(authority)
        elif trust is None and ours is not None and ours.certificate is not None:
            trust = pinned(ours.certificate)
        self._http = httpx.Client(
            base_url=self.url,
            timeout=limit_s,
            trust_env=False,
            headers={"Authorization": authorization} if authorization else {},
            verify=trust or True,
        )

    def __enter__(self) -> "DaemonClient":
        return self

    def __exit__(self, *_: object) -> None:
        self._http.close()

    def get(self, path: str) -> Any:
        """The JSON answer of a GET."""
        return self._request(lambda: self._http.get(path)).json()

    def read(self, path: str) -> bytes:
        """The content of a GET."""
        return self._request(lambda: self._http.get(path)).content

    def post(self, path: str, body: dict[str, Any] | None = None) -> Any:
        """The JSON answer of a POST; `body` goes as JSON."""
        return self._request(lambda: self._http.post(path, json=body or {})).json()

    def download(self, path: str, file: Path) -> int:
        """GET into `file`; returns its size in bytes."""
        with self._translate_errors(), self._http.stream("GET", path) as answer:
            if answer.is_error:
                answer.read()
                raise problem_error(self.url, answer)
            with file.open("wb") as out:
                for block in answer.iter_bytes():
                    out.write(block)
        return file.stat().st_size

    def run(self, path: str, body: dict[str, Any] | None, on_event: Callable[[ServerEvent], None]) -> Any:
        """Start a run with a POST and follow it to its end; `on_event` receives its events. Returns the run."""
        with (
            self._translate_errors(),
            self._http.stream("GET", "/events", timeout=httpx.Timeout(MAX_ANSWER_S, read=None)) as news,
        ):
            if news.is_error:
                news.read()
                raise problem_error(self.url, news)
            events = parse_sse(news.iter_lines())
            next(events)  # the first comment: from here on no event is missed
            run: Any = None
            try:
                with defer_interrupts():
                    started = self.post(path, body)
                    run = started.get("run") or started
                for event in events:
                    if event.get("id") != run["id"]:
                        continue
                    on_event(event)
                    if event["state"] in FINAL_STATES:
                        return self.get(f"/runs/{run['id']}")
            except (KeyboardInterrupt, SystemExit):
                if run is not None:  # do not leave the arm moving
                    self.post(f"/runs/{run['id']}/abort")
                raise
        raise CommandError(
            self.url, f"the daemon stopped during run {run['id']}", "start it again; its views are stored"
        )

    def _request(self, request: Callable[[], httpx.Response]) -> httpx.Response:
        with self._translate_errors():
            answer = request()
        if answer.is_error:
            raise problem_error(self.url, answer)
        return answer

    @contextmanager
    def _translate_errors(self) -> Iterator[None]:
        try:
            yield
        except httpx.ConnectError as error:
            if "CERTIFICATE" in str(error).upper():
                what, fix = "its certificate is not trusted", "name its authority.pem in HANDEYED_CA"
                raise CommandError(self.url, what, fix) from None
            fix = "start it with 'handeyed serve CONFIG', or give its address with --url"
            raise NoDaemon(self.url, "no daemon answers", fix) from None
        except httpx.TimeoutException:
            raise CommandError(
                self.url, "no answer in time", f"look at {self.url}/health and the daemon's log"
            ) from None
        except (httpx.InvalidURL, httpx.UnsupportedProtocol):
            fix = f"give one such as {DEFAULT_URL}"
            raise CommandError(self.url, "not an address", fix, ExitStatus.UNREADABLE) from None
        except httpx.HTTPError as error:
            raise CommandError(self.url, f"the connection broke ({error})", "look at the daemon's log") from None


def _tls_context(authority: str) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError):
        raise CommandError(authority, "not an authority's certificate", "set HANDEYED_CA to authority.pem") from None


@contextmanager
def defer_interrupts() -> Iterator[None]:
    """Defer Ctrl-C and SIGTERM to the end of the block, so that a started run's id is not lost."""
    caught: list[int] = []
    before = {
        number: signal.signal(number, lambda number, frame: caught.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if caught:
        signal.raise_signal(caught[0])


def parse_sse(lines: Iterator[str]) -> Iterator[ServerEvent]:
    """Yield the JSON data of server-sent events, and {} for each comment."""
    for line in lines:
        if line.startswith(":"):
            yield {}
        elif line.startswith("data:"):
            yield json.loads(line.removeprefix("data:"))


def problem_error(url: str, answer: httpx.Response) -> CommandError:
    """The CommandError for an error answer: from problem+json, else from the status."""
    try:
        document = answer.json()
        what, fix = str(document["detail"]), str(document["fix"])
    except (ValueError, KeyError, TypeError):
        what, fix = f"HTTP {answer.status_code} {answer.reason_phrase}", "is this the daemon's address?"
    return CommandError(f"{url}{answer.url.path}", what, fix)
