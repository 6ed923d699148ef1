"""A client of the daemon's REST interface, for the MES and for scripts; the commands use it, too.

    from handeyed import Client

    with Client("http://cell-7:8372", key="hek_...") as cell:
        run = cell.wait(cell.start("/calibrate", {"tolerance_mm": 0.5}))
        made = cell.result(run)                              # a CalibrationDocument; RunFailed says why there is none
        cell.activate(made.id, by="MES")
        points_base = cell.register(points)                  # (n, 3) in mm, of where the arm stands now

Every method raises ClientError (handeyed/errors.py). Lengths are in mm.
"""

import json
import os
import signal
import ssl
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NotRequired, Self, TypedDict
from urllib.parse import quote

import httpx

from calibration.errors import DocumentError
from daemon.model.run_states import FINAL_STATES
from handeyed.errors import ClientError, ConnectionBroke, NoDaemon, NotAnAddress, Refused, RunFailed
from registration.errors import CloudError
from registration.io.durable_file import GuardedFile, new_file

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from calibration.documents.calibration import CalibrationDocument

TLS_ERRORS = (
    ("CERTIFICATE", "its certificate is not trusted", "name its authority.pem in HANDEYED_CA"),
    ("WRONG_VERSION_NUMBER", "what answers speaks no TLS", "begin its address with http://"),
    ("RECORD_LAYER_FAILURE", "what answers speaks no TLS", "begin its address with http://"),
)
"""What a connection's error has in its text, what that means, and what to do; the first that fits counts."""

DEFAULT_URL = "http://127.0.0.1:8372"
MAX_ANSWER_S = 30.0
"""Only runs take longer; they are waited for in pieces of POLL_S."""

POLL_S = 20.0
MAX_TRIES = 3
"""How often the start of a run is sent, with one Idempotency-Key: it starts once."""

JSON = "application/json"
MEDIA_TYPES = {".ply": "application/x-ply", ".pcd": "application/x-pcd", ".bin": "application/octet-stream",
               ".las": "application/vnd.laszip", ".laz": "application/vnd.laszip"}  # fmt: skip

ServerEvent = dict[str, Any]
"""The data of an event; `event` and `number` say its kind and where to go on."""


class Cause(TypedDict):
    """Why a run failed or was aborted; `details`: what these sentences are made of, for other languages."""

    code: str
    what: str
    fix: str
    details: NotRequired[dict[str, Any]]


class Run(TypedDict):
    """A run as the daemon answers it; docs/openapi.json, RunDocument, has the fields that are not named here."""

    id: str
    kind: str
    state: str
    over: bool
    station: int
    stations: int
    cause: Cause | None
    result: dict[str, Any] | None
    planning: dict[str, Any] | None
    links: dict[str, str]


class Client:
    """One daemon at one address.

    key : an API key; HANDEYED_KEY of the environment without it. None: the daemon asks for none.
    ca : the authority of the daemon's certificate, a file; HANDEYED_CA of the environment without it.
    tls : in place of `ca` and of the system's authorities.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        key: str | None = None,
        ca: str | Path | None = None,
        tls: ssl.SSLContext | None = None,
        timeout_s: float = MAX_ANSWER_S,
    ) -> None:
        self.url, self._timeout_s = url.rstrip("/"), timeout_s
        key, authority = key or os.environ.get("HANDEYED_KEY") or "", ca or os.environ.get("HANDEYED_CA")
        if tls is None and authority:
            try:
                tls = ssl.create_default_context(cafile=authority)
            except (OSError, ssl.SSLError):
                what, fix = "not an authority's certificate", "set HANDEYED_CA to authority.pem"
                raise NotAnAddress(str(authority), what, fix) from None
        key = _header("key", key.strip())
        with self._translate_errors():
            self._http = httpx.Client(
                base_url=self.url,
                timeout=timeout_s,
                trust_env=False,
                headers={"Authorization": f"Bearer {key}"} if key else {},
                # Plain HTTP needs no authorities, and reading them takes 40 ms of processor time.
                verify=tls or (ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT) if self.url.startswith("http:") else True),
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End its connections."""
        self._http.close()

    def get(self, path: str) -> Any:
        """The JSON answer of a GET."""
        return self._answer("GET", path).json()

    def read(self, path: str) -> bytes:
        """The content of a GET."""
        return self._answer("GET", path, media_type="").content

    def post(self, path: str, body: dict[str, Any] | None = None) -> Any:
        """The JSON answer of a POST, None for one without content; `body` goes as JSON."""
        answer = self._answer("POST", path, json=body or {})
        return answer.json() if answer.content else None

    def download(self, path: str, file: str | Path) -> int:
        """GET into `file`, which appears when it is whole; its size in bytes."""
        with self._translate_errors():
            return self._stream_into(Path(file), "GET", path)

    def start(
        self, path: str, body: dict[str, Any] | None = None, *, wait_s: float = 0.0, retry_key: str | None = None
    ) -> Run:
        """Start a run with a POST to /calibrate, /verify, /scans or /robot/jog: THE ARM MOVES. The run.

        Answered when the run is over, or after `wait_s` as it is then. A start whose answer is lost is sent again with
        the same Idempotency-Key, and never starts twice; `retry_key` is yours, to go on after a crash of your program.
        """
        headers = {"Idempotency-Key": _header("retry_key", retry_key or str(uuid.uuid4()))}
        params, limit_s = ({"wait": wait_s} if wait_s else {}), self._timeout_s + wait_s
        for tries in range(1, MAX_TRIES + 1):
            try:
                answer = self._answer("POST", path, json=body or {}, headers=headers, params=params, timeout=limit_s)
                break
            except ConnectionBroke:
                if tries == MAX_TRIES:
                    raise
            except Refused as refused:
                if tries == 1 or refused.code != "request-in-flight" or refused.problem.get("holder") is None:
                    raise
                return self.wait(self.run(refused.problem["holder"]), wait_s)  # of the try whose answer was lost
        started = answer.json()
        run: Run = started.get("run") or started  # of /scans
        return run

    def wait(self, run: Run, limit_s: float | None = None) -> Run:
        """The run when it is over, or after `limit_s` as it is then."""
        while not run["over"] and (limit_s is None or limit_s > 0):
            step_s = POLL_S if limit_s is None else min(POLL_S, limit_s)
            waiting: dict[str, Any] = {"params": {"wait": step_s}, "timeout": self._timeout_s + step_s}
            run = self._answer("GET", f"/runs/{run['id']}", **waiting).json()
            limit_s = None if limit_s is None else limit_s - step_s
        return run

    def follow(self, path: str, body: dict[str, Any] | None, on_event: Callable[[ServerEvent], None]) -> Run:
        """Start a run and follow it to its end: the run. `on_event` receives its events. Ctrl-C stops the arm."""
        run: Run | None = None
        with self._listen() as news:
            try:
                next(news)  # the first comment: from here on no event is missed
                with defer_interrupts():
                    run = self.start(path, body)
                for event in news:
                    if event.get("event") == "run" and event["id"] == run["id"]:
                        on_event(event)
                        if event["state"] in FINAL_STATES:
                            return self.run(run["id"])
            except (KeyboardInterrupt, SystemExit):
                if run is not None:  # do not leave the arm moving
                    self.abort(run)
                raise
        what = "the daemon stopped" if run is None else f"the daemon stopped during run {run['id']}"
        raise ConnectionBroke(self.url, what, "start it again; its pictures are stored")

    def run(self, run_id: str) -> Run:
        """The run as it is now."""
        run: Run = self.get(f"/runs/{quote(run_id, safe='')}")
        return run

    def abort(self, run: Run) -> Run:
        """Stop the arm, and end the run: the run. Refused with code `stop-unconfirmed`: press the emergency stop."""
        ended: Run = self.post(f"/runs/{run['id']}/abort")
        return ended

    def result(self, run: Run) -> "CalibrationDocument":
        """The calibration of a run that is over, accepted or not (`verdict`). Raises RunFailed."""
        return self.calibration(self.require_finished(run)["calibration_id"])

    def require_finished(self, run: Run) -> dict[str, Any]:
        """The `result` of a run that finished. Raises RunFailed with its cause."""
        if run["state"] == "finished" and run["result"] is not None:
            return run["result"]
        cause = run["cause"] or Cause(code="", what=f"the run was {run['state']}", fix="start it again")
        raise RunFailed(f"{self.url}/runs/{run['id']}", cause["what"], cause["fix"], code=cause["code"])

    def calibration(self, calibration_id: str) -> "CalibrationDocument":
        """calibration.json; `handeyed.register` and `handeyed.export` take it."""
        from calibration.documents.calibration import CalibrationDocument
        from calibration.documents.validation import validate_document

        document = self.get(f"/calibrations/{quote(calibration_id, safe='')}")
        with self._translate_errors():
            return validate_document(CalibrationDocument, document, self.url)

    def current(self) -> dict[str, Any] | None:
        """The active calibration (`calibration`, `applied`, `expanded_mm` and its like); None when none is active."""
        try:
            found: dict[str, Any] = self.get("/calibrations/current")
        except Refused as refused:
            if refused.code == "not-found":  # not of another server
                return None
            raise
        return found

    def activate(self, calibration_id: str, *, by: str, replacing: dict[str, Any] | None = None, **more: Any) -> Any:
        """Make a calibration the active one; `by`: who decided.

        replacing : what `current` answered when you decided: refused with code `applied-meanwhile` when another is
            active now. Without it, whichever is active is replaced.
        more : despite_verdict=True and reason="..." for one that was not accepted.
        """
        seen = {} if replacing is None else {"If-Match": f'"applied-{replacing["applied"]["sequence"]}"'}
        path = f"/calibrations/{quote(calibration_id, safe='')}/apply"
        return self._answer("POST", path, json={"applied_by": by, **more}, headers=seen).json()

    def register(self, points: "ArrayLike", base_T_flange: "ArrayLike | None" = None, **query: str) -> "NDArray[Any]":
        """Points (n, 3) of the scanner's frame in the robot's base frame, in mm, as float32.

        base_T_flange : (4, 4), where the arm stood; without it where it stands now.
        query : as POST /register has it: calibration, scanner, joints, external_axes, unit.
        """
        import numpy as np

        from handeyed.arrays import as_points

        with self._translate_errors():
            octets, kind = np.ascontiguousarray(as_points(points), "<f4").tobytes(), MEDIA_TYPES[".bin"]
            sent = {"params": {"pose": _pose_text(base_T_flange), **query}, "headers": {"Content-Type": kind}}
        answer = self._answer("POST", "/register", media_type=kind, content=octets, **sent)
        return np.frombuffer(answer.content, "<f4").reshape(-1, 3)

    def register_file(
        self, cloud: str | Path, out: str | Path, base_T_flange: "ArrayLike | None" = None, **query: str
    ) -> int:
        """A cloud's file (.ply, .pcd, .las, .laz, .bin) in the base frame as the file `out`; its size in bytes.

        Streamed: neither file is held in memory; `out` appears when it is whole. The arguments are those of `register`.
        """
        suffix = Path(cloud).suffix
        media_type = MEDIA_TYPES.get(suffix.lower())
        if media_type is None:
            raise ClientError(str(cloud), f"{suffix!r} is no cloud's", f"give one of {', '.join(MEDIA_TYPES)}")
        with self._translate_errors(), GuardedFile.reading(Path(cloud), str(cloud)) as file:
            sent = {"params": {"pose": _pose_text(base_T_flange), **query}, "headers": {"Content-Type": media_type}}
            return self._stream_into(Path(out), "POST", "/register", media_type, content=file.raw, **sent)

    def events(self, after: int | None = None) -> Iterator[ServerEvent]:
        """What happens in the cell, as it happens; `after`: the `number` of the last that you have seen, 0 for all.

        Ends when the daemon stops: connect again with that number, and nothing is missed.
        """
        with self._listen(after) as news:
            yield from filter(None, news)

    @contextmanager
    def _listen(self, after: int | None = None) -> Iterator[Iterator[ServerEvent]]:
        headers = {} if after is None else {"Last-Event-ID": str(after)}
        endless = httpx.Timeout(self._timeout_s, read=None)
        with self._translate_errors(), self._http.stream("GET", "/events", headers=headers, timeout=endless) as answer:
            self._require_success(answer, "text/event-stream")
            yield parse_sse(answer.iter_lines())

    def _answer(self, method: str, path: str, *, media_type: str = JSON, **request: Any) -> httpx.Response:
        with self._translate_errors():
            return self._require_success(self._http.request(method, path, **request), media_type)

    def _stream_into(self, file: Path, method: str, path: str, media_type: str = "", **request: Any) -> int:
        with self._http.stream(method, path, **request) as answer:
            self._require_success(answer, media_type)
            with new_file(file, durable=False) as out:
                for block in answer.iter_bytes():
                    out.write(block)
        return file.stat().st_size

    def _require_success(self, answer: httpx.Response, media_type: str) -> httpx.Response:
        """The answer. Raises Refused: from problem+json, else from status and type; another server answers anything."""
        of_ours = answer.headers.get("Content-Type", "").lower().startswith(media_type)
        if answer.is_success and (of_ours or answer.status_code == 204):
            return answer
        answer.read()
        try:
            problem = answer.json()
            what, fix = str(problem["detail"]), str(problem["fix"])
        except (ValueError, KeyError, TypeError):
            kind = f", {answer.headers.get('Content-Type', 'of no type')}" if answer.is_success else ""
            problem, what = {}, f"HTTP {answer.status_code} {answer.reason_phrase}{kind}"
            fix = "is this the daemon's address?"
        after = answer.headers.get("Retry-After", "")
        raise Refused(
            str(answer.url.copy_with(query=None)), what, fix,
            status=answer.status_code, problem=problem, retry_after_s=float(after) if after.isdigit() else None,
        )  # fmt: skip

    @contextmanager
    def _translate_errors(self) -> Iterator[None]:
        try:
            yield
        except httpx.ConnectError as error:
            for mark, what, fix in TLS_ERRORS:
                if mark in str(error).upper():
                    raise ClientError(self.url, what, fix) from None
            fix = "start it with 'handeyed serve CONFIG', or give its address with --url"
            raise NoDaemon(self.url, "no daemon answers", fix) from None
        except httpx.TimeoutException:
            fix = f"look at {self.url}/health and the daemon's log"
            raise ConnectionBroke(self.url, "no answer in time", fix) from None
        except DocumentError as error:
            first = error.problems[0]
            raise ClientError(f"{error.origin}: {first.place}", first.what, first.fix) from None
        except CloudError as error:
            raise ClientError(error.file, error.what, error.fix) from None
        except (httpx.InvalidURL, httpx.UnsupportedProtocol, UnicodeError):
            raise NotAnAddress(self.url, "not an address", f"give one such as {DEFAULT_URL}") from None
        except httpx.HTTPError as error:
            what = f"the connection broke ({error})"
            raise ConnectionBroke(self.url, what, "look at the daemon's log") from None


def _pose_text(base_T_flange: "ArrayLike | None") -> str:
    """The `pose` of a query: x,y,z,qw,qx,qy,qz, or "now"."""
    if base_T_flange is None:
        return "now"
    from calibration.documents.pose import PoseDocument
    from handeyed.arrays import as_pose

    pose = PoseDocument.of(as_pose(base_T_flange))
    return ",".join(repr(number) for number in (*pose.translation_mm, *pose.quaternion_wxyz))


def _header(name: str, value: str) -> str:
    """The value of a header. Raises ClientError, which does not show it."""
    if not (value.isascii() and value.isprintable()):
        raise ClientError(name, "it has characters that a header cannot hold", "use letters, digits and hyphens")
    return value


@contextmanager
def defer_interrupts() -> Iterator[None]:
    """Defer Ctrl-C and SIGTERM to the end of the block, so that a started run's id is not lost."""
    if threading.current_thread() is not threading.main_thread():  # only there do signals arrive
        yield
        return
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
    """Server-sent events: the JSON data of each with `event` and `number`; {} for each comment."""
    number, kind = 0, ""
    for line in lines:
        field, _, value = line.partition(": ")
        if line.startswith(":"):
            yield {}
        elif field == "id":
            number = int(value)
        elif field == "event":
            kind = value
        elif field == "data":
            yield {**json.loads(value), "event": kind, "number": number}
