"""The daemon's REST interface as commands use it: problems become lines on standard error."""

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

DEFAULT_URL = "http://127.0.0.1:8372"
ANSWER_LIMIT_S = 30.0
"""Nothing but a run takes longer, and runs are followed through their events."""

OVER = ("finished", "failed", "aborted")
"""States after which nothing more comes of a run."""

Event = dict[str, Any]


class DaemonClient:
    """One daemon at one address. Every method raises CommandError.

    HANDEYED_KEY holds the key to ask with, HANDEYED_CA the file of the authority that vouches for the daemon.
    """

    def __init__(self, url: str, limit_s: float = ANSWER_LIMIT_S) -> None:
        self.url = url.rstrip("/")
        key, authority = os.environ.get("HANDEYED_KEY"), os.environ.get("HANDEYED_CA")
        self._http = httpx.Client(
            base_url=self.url,
            timeout=limit_s,
            trust_env=False,
            headers={"Authorization": f"Bearer {key}"} if key else {},
            verify=_trusting(authority) if authority else True,
        )

    def __enter__(self) -> "DaemonClient":
        return self

    def __exit__(self, *_: object) -> None:
        self._http.close()

    def get(self, path: str) -> Any:
        """The JSON answer of a GET."""
        return self._asked(lambda: self._http.get(path)).json()

    def post(self, path: str, body: dict[str, Any] | None = None) -> Any:
        """The JSON answer of a POST; `body` goes as JSON."""
        return self._asked(lambda: self._http.post(path, json=body or {})).json()

    def download(self, path: str, file: Path) -> int:
        """The octets of a GET into `file`; how many they were."""
        with self._told(), self._http.stream("GET", path) as answer:
            if answer.is_error:
                answer.read()
                raise problem(self.url, answer)
            with file.open("wb") as out:
                for block in answer.iter_bytes():
                    out.write(block)
        return file.stat().st_size

    def run(self, path: str, body: dict[str, Any] | None, told: Callable[[Event], None]) -> Any:
        """Start a run with a POST and follow it: `told` gets its events; the finished run is the answer."""
        with (
            self._told(),
            self._http.stream("GET", "/events", timeout=httpx.Timeout(ANSWER_LIMIT_S, read=None)) as news,
        ):
            if news.is_error:
                news.read()
                raise problem(self.url, news)
            events = sse(news.iter_lines())
            next(events)  # the greeting: from here on nothing is missed
            run: Any = None
            try:
                with interrupts_deferred():
                    started = self.post(path, body)
                    run = started.get("run") or started
                for event in events:
                    if event.get("id") != run["id"]:
                        continue
                    told(event)
                    if event["state"] in OVER:
                        return self.get(f"/runs/{run['id']}")
            except (KeyboardInterrupt, SystemExit):
                if run is not None:  # whoever started the arm and leaves does not leave it moving
                    self.post(f"/runs/{run['id']}/abort")
                raise
        raise CommandError(
            self.url, f"the daemon stopped during run {run['id']}", "start it again; what it saw is stored"
        )

    def _asked(self, request: Callable[[], httpx.Response]) -> httpx.Response:
        with self._told():
            answer = request()
        if answer.is_error:
            raise problem(self.url, answer)
        return answer

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except httpx.ConnectError:
            fix = "start it with 'handeyed serve CONFIG', or give its address with --url"
            raise CommandError(self.url, "no daemon answers", fix) from None
        except httpx.TimeoutException:
            raise CommandError(
                self.url, "no answer in time", f"look at {self.url}/health and the daemon's log"
            ) from None
        except (httpx.InvalidURL, httpx.UnsupportedProtocol):
            fix = f"give one such as {DEFAULT_URL}"
            raise CommandError(self.url, "not an address", fix, ExitStatus.UNREADABLE) from None
        except httpx.HTTPError as error:
            raise CommandError(self.url, f"the connection broke ({error})", "look at the daemon's log") from None


def _trusting(authority: str) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError):
        raise CommandError(authority, "not an authority's certificate", "set HANDEYED_CA to authority.pem") from None


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait for the block's end: a request that may start the arm is not left half known."""
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


def sse(lines: Iterator[str]) -> Iterator[Event]:
    """Data of server-sent events; an empty one for each comment."""
    for line in lines:
        if line.startswith(":"):
            yield {}
        elif line.startswith("data:"):
            yield json.loads(line.removeprefix("data:"))


def problem(url: str, answer: httpx.Response) -> CommandError:
    """problem+json as an error; anything else by its status."""
    try:
        document = answer.json()
        what, fix = str(document["detail"]), str(document["fix"])
    except (ValueError, KeyError, TypeError):
        what, fix = f"HTTP {answer.status_code} {answer.reason_phrase}", "is this the daemon's address?"
    return CommandError(f"{url}{answer.url.path}", what, fix)
