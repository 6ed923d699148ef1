"""A mock cell, a daemon beside it that may be killed, people with keys, a PLC; each step checks its answer."""

import asyncio
import contextlib
import multiprocessing
import shutil
import signal
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from functools import cache
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from pymodbus.client import AsyncModbusTcpClient

from calibration.kinematics.abb_arms import find_arm
from calibration.transforms import map_points
from mock_robot.truth.truth import NO_NOISE, CellTruth
from protocols.plc.codes import ControlBit, StatusBit
from tests.daemon.access_keys import bearer
from tests.daemon.fakes import BASE_T_TARGET, BOARD
from tests.extensions.plc.plcs import Ladder
from tests.extensions.touch.touches import TIP, TIP_MM
from tests.mock_robot.running_cell import RunningCell, running_cell
from tests.stories.one_model.plant_process import (
    ARM,
    BOX_MM,
    CAMERA_LOST,
    CARRIED_MM,
    CLOCK,
    TAUGHT,
    WARM,
    plant_process,
)
from tests.stories.one_model.witness import Approaching, Witness
from tests.support.waiting import LIMIT_S, eventually, settle

MAY = ("admin", "operator")
"""Names of the keys that may move the arm; the others: "viewer", "nobody" (no key), "wrong" (none of this cell)."""
WAIT_S = 30.0
NOT_BEGUN = ("run-in-progress", "cell-busy")
"""Codes of refusals beside another run: nothing has moved for the request."""


@cache
def quiet_truth() -> CellTruth:
    """Poses are as reported: what a picture shows of a taught pose is drawn once."""
    return CellTruth.from_seed(7, noise=NO_NOISE)


def forks() -> Any:
    """A context whose processes begin with everything imported."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(WARM)
    return context


@dataclass
class World:
    """What the model knows beside what it sees.

    `acknowledged`: the final records of runs, and scans with their number of views, as answered; `sent`: requests for a
    run or a scan that may have been carried out. `in_force`: ids of which one must be active: several after an apply
    that was not answered. `audited`: the rows that the audit log must hold: action, subject, actor.
    """

    folder: Path
    cell: RunningCell
    witness: Witness
    sabotage: str = ""
    keys: dict[str, str] = field(default_factory=dict)
    runs: dict[str, dict[str, Any]] = field(default_factory=dict)
    scans: set[str] = field(default_factory=set)
    sent: int = 0
    calibrations: list[str] = field(default_factory=lambda: ["cal-1", "cal-2"])
    in_force: set[str] = field(default_factory=lambda: {""})
    audited: set[tuple[str, str, str]] = field(default_factory=set)
    verification: str = ""
    manual: bool = False
    off_s: float = 0.0
    process: BaseProcess | None = None
    counts: dict[str, int] = field(default_factory=dict)
    client: httpx.AsyncClient = field(init=False)
    plc: Ladder = field(init=False)
    _connections: contextlib.AsyncExitStack = field(default_factory=contextlib.AsyncExitStack)

    # --- the process ---

    async def start(self) -> None:
        ours, theirs = (context := forks()).Pipe()
        arguments = (str(self.folder), self.cell.announcement.robot_port, self.sabotage, theirs)
        process = context.Process(target=plant_process, args=arguments, daemon=True)
        process.start()
        self.process = process
        theirs.close()
        url, plc_port, keys = await asyncio.to_thread(_receive, ours)
        self.keys |= keys
        client = httpx.AsyncClient(base_url=url, timeout=LIMIT_S, verify=False, trust_env=False)
        self.client = await self._connections.enter_async_context(client)
        modbus = AsyncModbusTcpClient("127.0.0.1", port=plc_port, timeout=LIMIT_S, retries=0, reconnect_delay=0)
        self._connections.callback(modbus.close)
        assert await modbus.connect()
        self.plc = Ladder(modbus)
        await self._until_ready()

    async def _until_ready(self) -> None:
        """The devices are dialled in the background."""
        async with asyncio.timeout(LIMIT_S):
            while self.undisturbed and await self._robot_is_missing():  # noqa: ASYNC110 - it happens behind HTTP
                await asyncio.sleep(0.01)

    async def _robot_is_missing(self) -> bool:
        answer = await self.asks("viewer", "GET", "/ready")  # 503 before the first calibration is applied
        assert answer is not None
        return "robot" in str(answer.json()["calibrate"]["reasons"])

    async def end(self, how: signal.Signals) -> None:
        """The process ends by that signal; then nobody consents to anything."""
        assert self.process is not None
        if how is signal.SIGKILL:
            self.process.kill()
        else:
            self.process.terminate()
        await asyncio.to_thread(self.process.join)
        await settle()  # what it had sent still arrives
        self.process = None
        self.witness.run, self.manual = "", False
        await self._connections.aclose()
        await eventually(lambda: not self.cell.controller.armed and not self.cell.moving)
        self._count("SIGKILL" if how is signal.SIGKILL else "SIGTERM")

    async def close(self) -> None:
        """Whatever state it is in, also one in which it has not come up."""
        await self._connections.aclose()
        if self.process is not None:
            self.process.kill()
            await asyncio.to_thread(self.process.join)

    # --- requests ---

    async def asks(self, who: str, method: str, path: str, body: Any = None, **query: Any) -> httpx.Response | None:
        """The answer; None when the process has died."""
        moves = who in MAY and method == "POST"
        self.witness.asking += moves
        try:
            headers = {} if who == "nobody" else bearer(self.keys.get(who, "hek_wrong"))
            with contextlib.suppress(httpx.TransportError):
                return await self.client.request(method, path, json=body, headers=headers, params=query)
            return None
        finally:
            self.witness.asking -= moves

    async def read(self, path: str, who: str = "admin") -> Any:
        answer = await self.asks(who, "GET", path)
        assert answer is not None, path
        assert answer.status_code == 200, (path, answer.text)
        return answer.json()

    def _take(
        self, who: str, answer: httpx.Response | None, wanted: str, *, starts: bool = True
    ) -> dict[str, Any] | None:
        """The run that an answer tells of. Whoever may not is refused, and every refusal is typed."""
        self._count(wanted)
        if answer is None:
            self.sent += starts
            return None
        document: dict[str, Any] = answer.json()
        if who not in MAY and answer.status_code not in (401, 403):
            self.witness.wrong.append(f"consent: {wanted} by {who} was answered {answer.status_code}")
        if answer.status_code >= 400:
            self.sent += starts and document.get("code") == "stopping"  # the daemon ended first: it may have begun
            if "code" not in document or document["code"] == "internal-error":
                self.witness.wrong.append(f"answer: {wanted} was answered {answer.status_code} {answer.text[:200]}")
            return None
        run: dict[str, Any] = document.get("run") or document
        if "over" in run:
            self._note(run, who if starts else "")
        return document

    def _note(self, run: dict[str, Any], who: str = "") -> None:
        """What is known of a run from now on."""
        if who:
            if run["id"] not in self.runs:
                self.sent += 1
            self.audited.add(("run", run["id"], who))
        self.runs[run["id"]] = run
        if not run["over"]:
            self.witness.run = run["id"]
            return
        if self.witness.run == run["id"]:
            self.witness.run, self.manual = "", False
        result = run["result"] or {}
        if run["kind"] == "calibration" and run["state"] == "finished":
            self.calibrations.append(result["calibration_id"])
        if run["kind"] == "verify" and run["state"] == "finished":
            self.verification = run["id"]

    # --- steps ---

    async def starts(self, who: str, path: str, body: Any, wait: bool) -> None:
        answer = await self.asks(who, "POST", path, body, wait=WAIT_S if wait else 0)
        document = self._take(who, answer, f"{path} {'manual' if body.get('manual') else ''}".strip())
        if document is not None and path == "/scans":
            self.scans.add(document["id"])
        if document is not None and body.get("manual"):
            self.manual = True

    async def manual_step(self, who: str, step: str, body: Any) -> None:
        """A view, a jog or the end of a manual run."""
        if self.witness.run:
            answer = await self.asks(who, "POST", f"/runs/{self.witness.run}/{step}", body)
            self._take(who, answer, f"manual {step}", starts=False)

    async def approaches(self, who: str, direction: list[float] | None, tip: list[float], **body: Any) -> None:
        point = body.pop("point")
        if not self.verification:
            return
        target_mm = map_points(BASE_T_TARGET, BOARD.points_mm[[point]])[0]
        beside = bool(self.witness.run)  # what departs before the answer may be of that run, which may end meanwhile
        self.witness.approaching = Approaching(TIP_MM, None if direction is None else np.array(direction), target_mm)
        body |= {"verification": self.verification, "tip": TIP | {"flange_tip_mm": tip}, "touch": {"id": point}}
        body |= {} if direction is None else {"along": direction}
        try:
            answer = await self.asks(who, "POST", "/touch/approach", body, wait=WAIT_S)
            begun = answer is not None and answer.is_success
            if begun or not (beside or (answer is not None and answer.json().get("code") in NOT_BEGUN)):
                self.witness.wrong += self.witness.beyond
            self._take(who, answer, "approach")
        finally:
            self.witness.approaching, self.witness.beyond = None, []

    async def applies(self, who: str, index: int) -> None:
        wanted = self.calibrations[index % len(self.calibrations)]
        answer = await self.asks(who, "POST", f"/calibrations/{wanted}/apply", {"applied_by": who})
        self._count("apply")
        if answer is None:
            self.in_force |= {wanted}
        elif answer.is_success:
            self.in_force = {wanted}
            if who not in MAY:
                self.witness.wrong.append(f"consent: {who} applied a calibration")

    async def aborts(self, who: str) -> None:
        if not (run := self.witness.run):
            return
        answer = await self.asks(who, "POST", f"/runs/{run}/abort")
        self._count(f"abort {answer.status_code if answer is not None else 'unanswered'}")
        if answer is not None and answer.status_code == 200:
            self.witness.check_stopped("an abort was answered 200")
            self._note(answer.json())
        elif answer is not None and answer.status_code in (409, 502):
            await self.waits_for_the_end()

    async def waits_for_the_end(self) -> None:
        if self.witness.run and not self.manual:
            answer = await self.asks("viewer", "GET", f"/runs/{self.witness.run}", wait=WAIT_S)
            if answer is not None and answer.is_success:
                self._note(answer.json())

    async def waits_for_a_departure(self) -> None:
        before = self.witness.departures
        with contextlib.suppress(AssertionError):
            await eventually(lambda: self.witness.departures > before, 0.3)

    async def plc_sets(self, bits: ControlBit) -> None:
        """A trigger is held until it is answered; an abort until no run is in progress."""
        self._count(f"PLC {bits!r}")
        self.witness.asking += 1
        try:
            await self.plc.sets(ControlBit(0))
            await self.plc.sets(bits)
            with contextlib.suppress(TimeoutError):
                if bits in (ControlBit.TRIGGER_CALIBRATE, ControlBit.TRIGGER_VERIFY):
                    await self.plc.waits(StatusBit.TRIGGER_ACK, within_s=WAIT_S)
            await self._find_the_plcs_run()
        finally:
            self.witness.asking -= 1
        if bits is ControlBit.ABORT and self.witness.run:
            self.manual = False
            await self.waits_for_the_end()
        await self.plc.sets(ControlBit(0))

    async def _find_the_plcs_run(self) -> None:
        newest = (await self.read("/runs?limit=1", "viewer"))["runs"]
        if newest and newest[0]["id"] not in self.runs:
            self._note(await self.read(f"/runs/{newest[0]['id']}", "viewer"), newest[0]["started_by"])

    async def keys_change(self, name: str) -> None:
        """A key is made, refused to be used for more than its role, and revoked: then it opens nothing."""
        made = await self.asks("admin", "POST", "/keys", {"name": name, "role": "operator"})
        assert made is not None
        assert made.status_code == 201, made.text
        self.keys[name] = made.json()["key"]
        revoked = await self.asks("admin", "POST", f"/keys/{name}/revoke")
        assert revoked is not None
        assert revoked.is_success, revoked.text
        answer = await self.asks(name, "POST", "/robot/jog", {"axis": 6, "by_deg": 1.0})
        self._take("nobody", answer, "a revoked key")

    @property
    def undisturbed(self) -> bool:
        return not self.cell.controller.panel.emergency_stop

    async def emergency_stop(self, lasts: bool) -> None:
        """Pressed, or released where it is pressed; released at once when it does not last."""
        self._count("emergency stop")
        if pressed := self.undisturbed:
            self.cell.presses_emergency_stop(True)
            await self.waits_for_the_end()
        if not (lasts and pressed):
            self.recovers()

    def recovers(self) -> None:
        self.cell.presses_emergency_stop(False)
        self.cell.controller.recover(self.cell.cell.clock())
        self.cell.cell.nudge()

    async def link_fault(self, fault: str) -> None:
        self._count(fault)
        self.cell.inject_fault(fault, strikes=1)

    async def camera_is_lost(self, lasts: bool) -> None:
        """Lost, or found where it is lost; found at once when it does not last."""
        self._count("camera")
        file = self.folder / CAMERA_LOST
        if lost := not file.exists():
            file.touch()
            await self.waits_for_the_end()
        if not (lasts and lost):
            file.unlink()

    async def clock_jumps(self, by_s: float) -> None:
        self._count("clock")
        self.off_s += by_s
        (self.folder / CLOCK).write_text(str(self.off_s))

    # --- what must hold ---

    async def check_disarmed(self) -> None:
        """While nobody's request is in progress the arm stands, disarmed."""
        if self.witness.consent:
            return
        with contextlib.suppress(AssertionError):
            await eventually(lambda: not self.cell.controller.armed and not self.cell.moving, 10.0)
            return
        self.witness.wrong.append("armed: nobody's request is in progress, and the arm is moving or armed")

    def _count(self, what: str) -> None:
        self.counts[what] = self.counts.get(what, 0) + 1


def _receive(ready: Connection) -> Any:
    assert ready.poll(LIMIT_S), "the daemon did not start"
    return ready.recv()


@contextlib.asynccontextmanager
async def a_world(sabotage: str = "") -> AsyncIterator[World]:
    """A cell whose arm stands at the first taught pose, and a daemon with an empty store."""
    folder = Path(tempfile.mkdtemp(prefix="handeyed-model-"))
    made = running_cell(time_scale=60.0, truth=quiet_truth(), program="python", devices=False, apart=True)
    async with made as cell:
        controller = cell.controller
        joints = find_arm(ARM).inverse(TAUGHT[0])[0]
        controller.arm.jog(joints, 0.01, controller.robot_s(cell.cell.clock()))
        witness = Witness(cell, np.array(BOX_MM), np.array(CARRIED_MM))
        witness.watch()
        world = World(folder, cell, witness, sabotage)
        try:
            await world.start()
            yield world
        finally:
            await world.close()
            shutil.rmtree(folder, ignore_errors=True)
