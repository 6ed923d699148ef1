"""One cell: what its daemon says of itself as it says it, and requests to it. Speaks REST and server-sent events."""

import asyncio
import json
import logging
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import quote

import httpx

from gateways.opcua.cell_state import FINAL, CellState
from gateways.opcua.settings import CellSettings, GatewayError

log = logging.getLogger(__name__)

SILENCE_S = 5.0
"""GET /live has a message each second: after so long without one the daemon counts as away."""

CONNECT_S = 3.0
ANSWER_S = 20.0
MAX_PAUSE_S = 4.0
"""Between two attempts to reach a daemon that is away; the first comes after 0.25 s."""

HEARTBEAT_S = 30.0
"""GET /events sends a comment at least this often."""

ODD_ANSWER = (ValueError, LookupError, TypeError, AttributeError)
"""What an answer raises that is none of a daemon's."""

REFRESHED_BY = frozenset({"calibration", "applied", "drift", "lost"})
"""Kinds of events after which the active calibration and the chart are read anew."""


@dataclass
class Refusal(Exception):
    """The daemon refused a request. `status`: of HTTP; `code`, `what`, `fix`: of its problem document."""

    status: int
    code: str
    what: str
    fix: str

    def __str__(self) -> str:
        return f"{self.code}: {self.what}: {self.fix}"


class Away(Exception):
    """The daemon does not answer."""


class Cell:
    """One daemon. `on_change` gets each new state, `on_result` each run that ended, once."""

    def __init__(
        self,
        settings: CellSettings,
        on_change: Callable[[CellState], Awaitable[None]],
        on_result: Callable[[Mapping[str, Any]], Awaitable[None]],
    ) -> None:
        self.name = settings.name
        self.state = CellState()
        self._key = settings.key()
        self._on_change, self._on_result = on_change, on_result
        self._last_event: str | None = None
        try:
            trusted = ssl.create_default_context(cafile=settings.ca_file) if settings.ca_file else True
        except (OSError, ssl.SSLError) as error:
            raise GatewayError(str(settings.ca_file), str(error), "name the authority.pem of the daemon") from None
        self._http = httpx.AsyncClient(
            base_url=settings.url,
            verify=trusted,
            trust_env=False,
            timeout=httpx.Timeout(ANSWER_S, connect=CONNECT_S),
            limits=httpx.Limits(max_connections=20),
        )

    async def follow(self) -> None:
        """Follow the daemon until cancelled; a daemon that is away is asked again every MAX_PAUSE_S at the latest."""
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._again(self._follow_live), name=f"{self.name}: /live")
                tasks.create_task(self._again(self._follow_events), name=f"{self.name}: /events")
        finally:
            await self._http.aclose()

    async def get(self, path: str, key: str | None = None, **query: Any) -> Any:
        """The JSON answer of a GET, by the reader's key unless another is given. Raises Refusal, Away."""
        return (await self._request("GET", path, key or self._key, params=query)).json()

    async def post(self, path: str, key: str | None, body: Mapping[str, Any], headers: Mapping[str, str]) -> Any:
        """The JSON answer of a POST by a session's own key. Raises Refusal, Away."""
        return (await self._request("POST", path, key, json=dict(body), headers=dict(headers))).json()

    async def start(self, path: str, body: Mapping[str, Any], ticket: str, key: str | None) -> Mapping[str, Any]:
        """The run that is started, or that was started with this ticket before. Raises Refusal, Away."""
        answer = await self.post(path, key, body, {"Idempotency-Key": ticket})
        started: Mapping[str, Any] = answer.get("run") or answer
        if not started.get("over"):
            await self._change(self.state.after({"run": started}))  # before the next beat of /live
        return started

    async def abort(self, key: str | None) -> None:
        """Stop the run in progress, if there is one. Raises Refusal, Away.

        The daemon is asked which: /live may be a beat behind, and name one that is over. It counts where that fails.
        """
        known = self.state.run
        try:
            newest = (await self.get("/runs", key, limit=1))["runs"]
        except (Away, Refusal):
            if known is None:
                raise
        else:
            known = newest[0] if newest and not newest[0]["over"] else None
        if known is not None:
            await self.post(f"/runs/{quoted(known['id'])}/abort", key, {}, {})

    async def _request(self, method: str, path: str, key: str | None, **request: Any) -> httpx.Response:
        headers = {**request.pop("headers", {}), **_authorise(key)}
        try:
            answer = await self._http.request(method, path, headers=headers, **request)
        except httpx.HTTPError as error:
            raise Away(f"{self.name}: {type(error).__name__} {error}") from None
        if answer.is_error:
            raise _refusal(answer)
        return answer

    async def _again(self, follow: Callable[[], Awaitable[None]]) -> None:
        pause_s = 0.25
        while True:
            try:
                await follow()
                pause_s = 0.25
            except (httpx.HTTPError, Away, Refusal, *ODD_ANSWER) as error:  # no cell ends the others
                if pause_s == 0.25:
                    log.warning("%s: %s %s", self.name, type(error).__name__, error)
                pause_s = min(MAX_PAUSE_S, 2 * pause_s)
            await asyncio.sleep(pause_s)

    async def _follow_live(self) -> None:
        try:
            await self._refresh()
            async for _, message in self._listen("/live", {}, SILENCE_S):
                run_before = self.state.run
                await self._change(self.state.after(message))
                if run_before is not None and self.state.run is None:
                    await self._ask_readiness()
        finally:
            await self._change(CellState(last=self.state.last))

    async def _follow_events(self) -> None:
        if self._last_event is None:  # a run that ended before is read, one that ends from here on is heard of
            now = str((await self.get("/session"))["last_event_id"])
            ended = [run for run in (await self.get("/runs", limit=2))["runs"] if run["over"]]
            last = await self.get(f"/runs/{ended[0]['id']}") if ended else None
            await self._change(replace(self.state, last=last))
            self._last_event = now
        async for number, event in self._listen("/events", {"Last-Event-ID": self._last_event}, 3 * HEARTBEAT_S):
            kind = event["event"]
            if kind == "run" and event.get("state") in FINAL:
                try:
                    run = await self.get(f"/runs/{quoted(event['id'])}")
                except Refusal as refusal:
                    if refusal.status != 404:
                        raise
                    log.warning("%s: %s has ended, and is no longer stored", self.name, event["id"])
                else:
                    await self._change(replace(self.state, last=run))
                    await self._on_result(run)
                self._last_event = number or self._last_event  # it is sent once, also when the next question fails
                await self._ask_readiness()
            elif kind in REFRESHED_BY and self.state.reached:
                await self._refresh()
            elif kind == "arm":
                unconfirmed = not (event.get("stopped") and event.get("disarmed"))
                await self._change(replace(self.state, stop_unconfirmed=unconfirmed))
            elif kind == "store":
                await self._change(replace(self.state, store_sound=bool(event["sound"])))
            self._last_event = number or self._last_event

    async def _ask_readiness(self) -> None:
        """Readiness lags in /live by a second after a run."""
        ready = await self.get("/ready")
        run, last = self.state.run, self.state.last
        over = run is not None and last is not None and run["id"] == last["id"]
        await self._change(self.state.after({"ready": ready, "run": None if over else run}))

    async def _refresh(self) -> None:
        """Read what only changes by an event."""
        current = None
        with suppress(Refusal):  # no calibration is active
            current = await self.get("/calibrations/current")
        drift = await self.get("/drift")
        gauges = _gauges((await self._request("GET", "/metrics", self._key)).text)
        stopping = gauges.get("handeyed_arm_stop_unconfirmed", 0.0) > 0
        sound = gauges.get("handeyed_store_sound", 1.0) > 0
        shown = replace(self.state, current=current, drift=drift, stop_unconfirmed=stopping, store_sound=sound)
        await self._change(shown)

    async def _listen(
        self, path: str, headers: Mapping[str, str], silence_s: float
    ) -> AsyncIterator[tuple[str, dict[str, Any]]]:
        """The number and the data of each server-sent event, with its kind as `event`."""
        limits = httpx.Timeout(ANSWER_S, connect=CONNECT_S, read=silence_s)
        sent = {**headers, **_authorise(self._key)}
        async with self._http.stream("GET", path, headers=sent, timeout=limits) as answer:
            if answer.is_error:
                await answer.aread()
                raise _refusal(answer)
            number = kind = ""
            async for line in answer.aiter_lines():
                name, _, value = line.partition(": ")
                if name == "id":
                    number = value
                elif name == "event":
                    kind = value
                elif name == "data":
                    yield number, {**json.loads(value), "event": kind}

    async def _change(self, state: CellState) -> None:
        if state != self.state:
            self.state = state
            await self._on_change(state)


def quoted(identifier: str) -> str:
    """An id as one segment of a path: no client's id reaches another path."""
    return quote(identifier, safe="") if identifier.strip(".") else "none"


def _authorise(key: str | None) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"} if key else {}


def _refusal(answer: httpx.Response) -> Refusal:
    try:
        problem = answer.json()
        return Refusal(answer.status_code, problem["code"], problem["detail"], problem["fix"])
    except (ValueError, KeyError, TypeError):
        return Refusal(answer.status_code, "", f"HTTP {answer.status_code}", "is this the daemon's address?")


def _gauges(text: str) -> dict[str, float]:
    """The values of /metrics that have no labels."""
    pairs = (line.rsplit(" ", 1) for line in text.splitlines() if line and not line.startswith("#") and "{" not in line)
    return {name: float(value) for name, value in pairs}
