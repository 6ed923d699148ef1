"""One poller of the cell for every listener of GET /live. It runs while somebody listens."""

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Collection
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel, RootModel

from daemon.api.http_errors import TooManyListeners
from daemon.api.readiness import readiness
from daemon.api.schemas.cell import LookDocument, RobotDocument
from daemon.api.schemas.runs import RunDocument
from daemon.application import Application, CellCamera
from daemon.cell.device_watch import DeviceState
from daemon.cell.readings import RobotReading
from daemon.errors import DaemonError
from daemon.model.records import RunRecord
from daemon.model.run_states import RunState
from daemon.runtime.version import SOFTWARE
from daemon.sessions.look import Look
from drivers.errors import DeviceError

DECIMALS = 6
"""Digits after the point: 1 nm, 1e-6 degrees. Readings are noisier, and their text is sent every second."""

Snapshot = dict[str, str]
"""The JSON of each key of the message."""


def json_of(value: BaseModel | list[BaseModel] | str | None) -> str:
    """Compact JSON with DECIMALS digits."""
    if isinstance(value, BaseModel):
        return json.dumps(_rounded(value.model_dump(mode="json", by_alias=True)), separators=(",", ":"))
    if isinstance(value, list):
        return f"[{','.join(json_of(one) for one in value)}]"
    return json.dumps(value)


def message_of(snapshot: Snapshot, sent: Snapshot) -> bytes:
    """The server-sent event with `at` and every key that differs from what was sent before."""
    changed = {key: text for key, text in snapshot.items() if key == "at" or sent.get(key) != text}
    fields = ",".join(f'"{key}":{text}' for key, text in changed.items())
    return f"event: live\ndata: {{{fields}}}\n\n".encode()


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, DECIMALS)
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_rounded(item) for item in value]
    return value


log = logging.getLogger(__name__)

MAX_LISTENERS = 64

BEAT_S = 1.0
"""Every listener gets a message at least this often, also when nothing has changed."""

FAST_S = 0.2
"""Interval of the poller while the arm moves or is jogged; of the robot's reading, too."""

MAX_READING_AGE_S = 3.0
"""Without a reading of the robot for this long, `robot` is null."""

MOVES = frozenset({RunState.MOVING, RunState.WAITING})
"""States of a run in which the robot is read in steps of FAST_S; in the others the run itself reads it."""


def require_room(addresses: Collection[str], address: str) -> None:
    """Raises TooManyListeners when all places are taken, or half of them by this address."""
    if len(addresses) >= MAX_LISTENERS or list(addresses).count(address) >= MAX_LISTENERS // 2:
        raise TooManyListeners(len(addresses))


@dataclass(eq=False)
class Listener:
    """One listener, the address it asks from, and what it was sent last."""

    address: str
    sent: Snapshot = field(default_factory=dict)


class LiveFeed:
    """Reads the cell once for all listeners. A slow listener misses states in between, and gets the newest."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self._listeners: set[Listener] = set()
        self._poller: asyncio.Task[None] | None = None
        self._snapshot: Snapshot = {}
        self._news = asyncio.Event()
        self._reading: asyncio.Task[RobotReading] | None = None
        self._robot: RobotReading | None = None
        self._robot_at_s = self._asked_at_s = self._readiness_at_s = self._beat_at_s = float("-inf")
        self._ready = self._look_text = "null"
        self._ready_of = "{}"
        self._looking: asyncio.Task[Look] | None = None

    def admit(self, address: str) -> Listener:
        """A place for one listener, until `release`; one address has at most half of them. Raises TooManyListeners."""
        require_room([listener.address for listener in self._listeners], address)
        listener = Listener(address)
        self._listeners.add(listener)
        if self._poller is None or self._poller.done():
            self._readiness_at_s = float("-inf")
            self._poller = asyncio.create_task(self._poll(), name="reads the cell for GET /live")
        return listener

    def release(self, listener: Listener) -> None:
        """The listener has left; with the last one the poller ends, and nothing that it has read is kept."""
        self._listeners.discard(listener)
        if self._listeners or self._poller is None:
            return
        for task in (self._poller, self._reading, self._looking):
            if task is not None:
                task.cancel()
        self._poller = self._reading = self._looking = self._robot = None
        self._snapshot, self._asked_at_s = {}, float("-inf")

    async def messages(self, listener: Listener) -> AsyncIterator[bytes]:
        """The first message is whole, the next ones have `at` and what has changed. Ends when the daemon stops."""
        ended = asyncio.create_task(self._app.events.ended.wait())
        try:
            while not self._app.events.closed:
                news, snapshot = self._news, self._snapshot
                if snapshot and snapshot is not listener.sent:
                    message, listener.sent = message_of(snapshot, listener.sent), snapshot
                    yield message
                    continue
                waiting = asyncio.create_task(news.wait())
                await asyncio.wait([waiting, ended], return_when=asyncio.FIRST_COMPLETED)
                waiting.cancel()
        finally:
            ended.cancel()

    async def _poll(self) -> None:
        failing = False
        while True:
            fast = False
            try:
                fast = await self._look()
                failing = False
            except Exception:  # the beat stays away, and the page says so, until it works again
                if not failing:
                    log.exception("reading the cell for GET /live failed")
                failing = True
            await self._app.clock.sleep(FAST_S if fast else BEAT_S)

    async def _look(self) -> bool:
        """Take a snapshot and pass it on when it is due; returns whether the next look is due in FAST_S."""
        now_s, run = self._app.clock.monotonic_s(), self._app.supervisor.in_progress
        fast = (run is not None and run.state in MOVES) or (self._robot is not None and self._robot.status.moving)
        await self._read_robot(now_s, FAST_S if fast else BEAT_S)
        if now_s - self._readiness_at_s >= 0.99 * BEAT_S:
            self._readiness_at_s = now_s
            main, *further = [(camera.name, await self._readiness_of(camera)) for camera in self._app.cameras]
            self._ready = main[1]
            self._ready_of = f"{{{','.join(f'{json_of(name)}:{text}' for name, text in further)}}}"
        await self._look_at_target(run)
        model, cell, robot = self._app.operations.rules.model, self._app.cell, None
        if self._robot is not None:
            robot = RobotDocument.of(self._robot, cell.robot, cell.holder, model)
        snapshot = self._take(robot)
        changed = {**snapshot, "at": ""} != {**self._snapshot, "at": ""}
        if changed or now_s - self._beat_at_s >= 0.99 * BEAT_S:
            self._beat_at_s, self._snapshot = now_s, snapshot
            news, self._news = self._news, asyncio.Event()
            news.set()
        return fast or run is not None

    async def _read_robot(self, now_s: float, interval_s: float) -> None:
        """Ask for a reading when one is due, and take it when it comes within FAST_S; it is never asked for twice."""
        if self._reading is None and now_s - self._asked_at_s >= 0.99 * interval_s:
            self._asked_at_s = now_s
            self._reading = asyncio.create_task(self._app.readings.robot.read())
        if self._reading is not None:
            await asyncio.wait([self._reading], timeout=FAST_S)
            if self._reading.done():
                reading, self._reading = self._reading, None
                try:
                    self._robot, self._robot_at_s = reading.result(), self._app.clock.monotonic_s()
                except DeviceError as error:
                    self._robot = None
                    self._app.device_watch.note("robot", error)
        if now_s - self._robot_at_s > MAX_READING_AGE_S:
            self._robot = None

    async def _look_at_target(self, run: RunRecord | None) -> None:
        """Where the target is in the picture, while a run waits for its operator; at most twice a second."""
        if run is None or run.state is not RunState.WAITING:
            self._look_text = "null"
            return
        if self._looking is None:
            self._looking = asyncio.create_task(self._app.cameras[0].looks.read())
        await asyncio.wait([self._looking], timeout=0)
        if self._looking.done():
            looking, self._looking = self._looking, None
            try:
                self._look_text = json_of(LookDocument.of_look(looking.result()))
            except DeviceError as error:
                self._look_text = "null"
                self._app.device_watch.note("camera", error)

    async def _readiness_of(self, camera: CellCamera) -> str:
        with suppress(DaemonError, DeviceError):
            return json_of(await readiness(self._app, camera))
        return "null"

    def _take(self, robot: RobotDocument | None) -> Snapshot:
        app = self._app
        run = app.supervisor.in_progress
        return {
            "at": json_of(app.clock.timestamp()),
            "software": json_of(SOFTWARE),
            "robot": json_of(robot),
            "run": json_of(None if run is None else RootModel[RunDocument](RunDocument.of(run))),
            "devices": json_of([RootModel[DeviceState](state) for state in app.device_watch.states()]),
            "ready": self._ready,
            "ready_of": self._ready_of,
            "holder": json_of(app.cell.holder),
            "look": self._look_text,
        }
