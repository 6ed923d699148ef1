"""A witness of every move at the mock cell: was it asked for, by somebody who may, with the gate seen closed?"""

import asyncio
import contextlib
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from pymodbus.client import AsyncModbusTcpClient

from daemon.access.roles import Role
from daemon.application import Application
from daemon.cell.cell import Devices
from daemon.composition import build
from daemon.model.records import AppliedCalibration, CalibrationRecord, RunRecord
from daemon.model.run_states import RunState
from daemon.server import Server
from drivers.registry import open_robot
from extensions.plc.extension import PlcSwitch
from protocols.modbus.codes import Function
from protocols.plc.codes import ControlBit, StatusBit
from tests.daemon.access_keys import TEST, bearer
from tests.daemon.calibrations import a_calibration
from tests.daemon.fakes import FakeCamera, FakeRobot, FakeScanner
from tests.drivers.modbus_terminal import Terminal
from tests.extensions.plc.plcs import MOVING, Ladder
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.stories.plant import poses_taught_for, settings_of
from tests.support.serving import serve_for_tests
from tests.support.waiting import LIMIT_S, eventually

MAX_IDLE_S = 2.0
SCHEDULE_H = 0.2 / 3600
"""A verification is due as often as the schedule checks."""
NONE = ControlBit(0)


class Gate(Terminal):
    """A terminal whose first input is the gate. `seen`: closed when last read; `readings`, of them `openings`."""

    seen = False
    readings = 0
    openings = 0

    def bits(self, function: Function, address: int, count: int) -> Any:
        self.seen, self.readings = self.inputs[0], self.readings + 1
        self.openings += not self.seen
        return super().bits(function, address, count)


@dataclass
class Witness:
    """Records what is wrong with each departure of the arm.

    `entitled`: runs that somebody asked for and nobody has ended. `openings`: the gate's when the latest of them
    finished; None when it has not, and after a failed or aborted run: then nobody consents to scheduled verifications.
    """

    gate: Gate
    starting: int = 0
    entitled: set[str] = field(default_factory=set)
    latest: str = ""
    openings: int | None = None
    wrong: list[str] = field(default_factory=list)
    departures: int = 0
    scheduled: int = 0
    readings: int = 0

    def entitle(self, run: str) -> None:
        self.entitled.add(run)
        self.latest = run

    def withdraw(self) -> None:
        """From now on nobody's request is in progress, and nobody consents to a scheduled verification."""
        self.entitled.clear()
        self.openings = None

    def hear(self, kind: str, data: dict[str, Any]) -> None:
        """Take note of the end of a run."""
        if kind == "run" and data["state"] in (RunState.FAILED, RunState.ABORTED):
            self.openings = None
        if kind == "run" and data["state"] == RunState.FINISHED and data["id"] == self.latest:
            self.openings = self.gate.openings

    def _may_depart(self, run: RunRecord | None) -> bool:
        if run is not None and run.kind == "verify":  # only the schedule starts those here
            self.scheduled += 1
            return self.openings == self.gate.openings
        return self.starting > 0 or (run is not None and run.id in self.entitled)

    def watch(self, cell: RunningCell, run_in_progress: Callable[[], RunRecord | None]) -> None:
        """Look at every departure from now on."""
        depart = cell.controller.arm.depart

        def departs(*arguments: Any) -> Any:
            self.departures += 1
            run = run_in_progress()
            if not self._may_depart(run):
                self.wrong.append(f"departure {self.departures}: nobody's request is in progress ({run})")
            if not self.gate.seen or self.gate.readings == self.readings:
                self.wrong.append(f"departure {self.departures}: the gate was not seen closed before it")
            self.readings = self.gate.readings
            return depart(*arguments)

        cell.controller.arm.depart = departs  # type: ignore[method-assign]


@dataclass
class WatchedPlant:
    """Mock cell, daemon, gate, a PLC, an operator and a viewer with keys; each step of a history is a method."""

    cell: RunningCell
    gate: Gate
    witness: Witness
    folder: Path
    running: "contextlib.AsyncExitStack" = field(default_factory=contextlib.AsyncExitStack)
    keys: dict[str, str] = field(default_factory=dict)
    flood: list["asyncio.Task[Any]"] = field(default_factory=list)
    run: str = ""
    application: Application = field(init=False)
    client: httpx.AsyncClient = field(init=False)
    plc: Ladder = field(init=False)
    server: Server = field(init=False)

    def run_in_progress(self) -> RunRecord | None:
        return self.application.supervisor.in_progress

    async def restart(self) -> None:
        """The daemon ends in order, and starts again."""
        await self.stop()
        await self.start()

    async def start(self) -> None:
        signals = [{"name": "gate closed", "address": 0}]
        interlocks = {"address": f"tcp://127.0.0.1:{self.gate.port}", "limit_s": 5.0, "signals": signals}
        poses = [pose.model_dump(mode="json") for pose in poses_taught_for(7)[:3]]
        settings = settings_of(self.cell.announcement, self.folder).model_dump(mode="json", exclude_none=True)
        settings = type(settings_of(self.cell.announcement, self.folder)).model_validate(
            {
                **settings,
                "interlocks": interlocks,
                "plc": MOVING,
                "drift": {"every_h": SCHEDULE_H},
                "calibration": {**settings["calibration"], "poses": poses},
            }
        )
        arm = FakeRobot()
        self.application = build(
            settings,
            lambda made, _clock: Devices(
                open_robot(made.robot.address), FakeCamera(arm, blind=lambda _: True, size=(1920, 1200)), FakeScanner()
            ),
        )
        self._hear_events()
        served = await self.running.enter_async_context(serve_for_tests(self.application))
        self.server = served.server
        if not self.keys:
            for role in (Role.OPERATOR, Role.VIEWER):
                self.keys[role.word], _ = await self.application.key_service.add(role.word, role, TEST)
            await put_in_force(self.application)
        self.client = await self.running.enter_async_context(
            httpx.AsyncClient(base_url=served.url, verify=False, timeout=LIMIT_S)
        )

        port = self.application.service(PlcSwitch).service.tcp.port
        modbus = AsyncModbusTcpClient("127.0.0.1", port=port, timeout=LIMIT_S, retries=0, reconnect_delay=0)
        assert await modbus.connect()
        self.plc = Ladder(modbus)
        self.running.callback(modbus.close)

    async def stop(self) -> None:
        self.stop_flood()
        await self.running.aclose()
        self.witness.withdraw()

    def _hear_events(self) -> None:
        publish = self.application.events.publish

        def published(kind: str, data: dict[str, Any]) -> None:
            self.witness.hear(kind, data)
            publish(kind, data)

        self.application.events.publish = published  # type: ignore[method-assign]

    async def _post(self, path: str, who: str, **body: Any) -> httpx.Response:
        return await self.client.post(path, headers=bearer(self.keys[who]), json=body)

    # --- steps ---

    async def operator_starts(self) -> None:
        self.witness.starting += 1
        answer = await self._post("/scans", "operator", capture=True, name="part")
        if answer.status_code in (201, 202) and (run := self.run_in_progress()):
            self.run = run.id
            self.witness.entitle(run.id)
        self.witness.starting -= 1

    async def viewer_starts(self) -> None:
        answer = await self._post("/scans", "viewer", capture=True, name="part")
        assert answer.status_code == 403, answer.text

    async def operator_aborts(self) -> None:
        if not self.run:
            return
        answer = await self._post(f"/runs/{self.run}/abort", "operator")
        assert answer.status_code in (200, 409, 502), answer.text
        self.witness.entitled.discard(self.run)
        if answer.status_code == 200 and (self.cell.controller.armed or self.cell.moving):
            self.witness.wrong.append("an abort was answered with 200 while the arm was moving or armed")

    async def plc_triggers(self) -> None:
        """After READY the trigger is held until it is answered, each for MAX_IDLE_S at most, and released."""
        self.witness.starting += 1
        with contextlib.suppress(TimeoutError):
            await self.plc.waits(StatusBit.READY, within_s=MAX_IDLE_S)
        await self.plc.sets(NONE)
        await self.plc.sets(ControlBit.TRIGGER_CALIBRATE)
        with contextlib.suppress(TimeoutError):
            await self.plc.waits(StatusBit.TRIGGER_ACK, within_s=MAX_IDLE_S)
        if run := self.run_in_progress():
            self.run = run.id
            self.witness.entitle(run.id)
        await self.plc.sets(NONE)
        self.witness.starting -= 1

    async def plc_aborts(self) -> None:
        """The abort is held until no run is in progress; from then on nobody's is."""
        await self.plc.sets(ControlBit.ABORT)
        await eventually(lambda: not self.run_in_progress())
        self.witness.withdraw()
        if self.cell.moving:
            self.witness.wrong.append("a PLC's abort left no run in progress while the arm was moving")
        await self.plc.sets(NONE)

    async def plc_acknowledges(self) -> None:
        await self.plc.sets(ControlBit.RESULTS_ACK)
        await self.plc.sets(NONE)

    async def waits_for_a_move(self) -> None:
        seen = self.witness.departures
        with contextlib.suppress(AssertionError):
            await eventually(lambda: self.witness.departures > seen or not self.run_in_progress(), MAX_IDLE_S)

    async def waits_for_the_end(self) -> None:
        if run := self.run_in_progress():
            with contextlib.suppress(AssertionError):
                await eventually(lambda: self.run_in_progress() != run, MAX_IDLE_S)

    async def waits_for_the_schedule(self) -> None:
        seen = self.witness.scheduled
        with contextlib.suppress(AssertionError):
            await eventually(lambda: self.witness.scheduled > seen, MAX_IDLE_S)

    async def gate_moves(self) -> None:
        self.gate.inputs[0] = not self.gate.inputs[0]

    async def link_breaks(self) -> None:
        self.cell.inject_fault("link-reset", strikes=1)

    async def reply_is_lost(self) -> None:
        self.cell.inject_fault("link-reply-lost", strikes=2)

    async def emergency_stop(self) -> None:
        self.cell.presses_emergency_stop(not self.cell.controller.panel.emergency_stop)

    async def readers_hang_up(self) -> None:
        """A hundred requests for the robot whose clients disconnect."""
        self.flood += [asyncio.create_task(self._read_and_hang_up()) for _ in range(100)]

    async def _read_and_hang_up(self) -> None:
        url = self.client.base_url
        with contextlib.suppress(OSError):
            _, writer = await asyncio.open_connection(url.host, url.port)
            key = bearer(self.keys["viewer"])["authorization"]
            writer.write(f"GET /robot HTTP/1.1\r\nHost: localhost\r\nAuthorization: {key}\r\n\r\n".encode())
            try:
                await writer.drain()
            finally:
                writer.close()

    async def signal_comes(self) -> None:
        """The process is asked to end, in whatever it does; the service manager starts it again."""
        self.server.handle_exit(signal.SIGTERM, None)
        await self.restart()

    def stop_flood(self) -> None:
        for task in self.flood:
            task.cancel()
        self.flood.clear()


STEPS = (
    WatchedPlant.operator_starts,
    WatchedPlant.viewer_starts,
    WatchedPlant.operator_aborts,
    WatchedPlant.plc_triggers,
    WatchedPlant.plc_aborts,
    WatchedPlant.plc_acknowledges,
    WatchedPlant.waits_for_a_move,
    WatchedPlant.gate_moves,
    WatchedPlant.link_breaks,
    WatchedPlant.reply_is_lost,
    WatchedPlant.emergency_stop,
    WatchedPlant.readers_hang_up,
    WatchedPlant.waits_for_the_end,
    WatchedPlant.waits_for_the_schedule,
    WatchedPlant.restart,
    WatchedPlant.signal_comes,
)


async def put_in_force(application: Application) -> None:
    """Store a calibration and apply it: without one nothing can be verified."""
    document = a_calibration("cal-1")
    await application.store.save_calibration(CalibrationRecord("cal-1", None, document.created_at, True, document))
    await application.store.apply(AppliedCalibration("cal-1", document.created_at, "test"))


@asynccontextmanager
async def watched_plant(folder: Path) -> AsyncIterator[WatchedPlant]:
    """A plant whose gate is closed, with a witness; nothing is in progress."""
    gate = Gate()
    server = await asyncio.start_server(gate.serve, "127.0.0.1", 0)
    gate.port = server.sockets[0].getsockname()[1]
    try:
        async with running_cell(time_scale=20.0, devices=True, program="python") as cell:
            plant = WatchedPlant(cell, gate, Witness(gate), folder)
            plant.witness.watch(cell, plant.run_in_progress)
            try:
                await plant.start()
                yield plant
            finally:
                await plant.stop()
    finally:
        server.close()
        for writer in gate.writers:
            writer.close()
        await server.wait_closed()
