"""Time from POST /runs/ID/abort to the arm's standstill, alone and beside floods: `python -m benchmarks.daemon.abort`.

Over TCP, a serial line (a pty), and Robot Web Services as the second way to stop, with the link to the arm silent. The
mock cell runs here, the daemon and the floods in processes of their own. "stop" is the time until the controller has
carried out the stop: the arm's own stopping time comes on top of it, and is in "stands". "own" is the same less the
time for which the daemon's event loop was ready to run and had no processor, as the kernel counts it, and "used" the
processor time of the event loop meanwhile: on a machine that others use, too, these are what the abort waits for.
"""

import argparse
import asyncio
import contextlib
import os
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from benchmarks.daemon.taught_poses import add_taught_poses
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text
from mock_robot.cell import MockCell, Ports
from mock_robot.truth.truth import CellTruth

SEED = 7
BAR_MS = 250.0
WAYS = ("tcp", "serial", "rws")
MAX_WAIT_S = 60.0
NEW_CONNECTIONS = httpx.Limits(max_keepalive_connections=0)
SPEED_MM_S = 2.0
"""Slow, so that the floods are at full strength while the arm is on its way."""


@dataclass
class Sample:
    """Milliseconds after the abort was sent: stop carried out, arm stands, answer; and the answer's status.

    `own_ms`: of `stop_ms`, without the event loop's waiting for a processor. `used_ms`: its processor time until then.
    """

    stop_ms: float
    own_ms: float
    used_ms: float
    stands_ms: float
    answer_ms: float
    status: int


@dataclass
class Row:
    """All aborts of one way, alone or beside the floods."""

    name: str
    samples: list[Sample] = field(default_factory=list)

    def text(self) -> str:
        def spread(values: list[float]) -> str:
            ordered = sorted(values)
            return f"{statistics.median(ordered):6.0f} {ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]:6.0f}"

        columns = [
            spread([getattr(s, name) for s in self.samples])
            for name in ("stop_ms", "own_ms", "used_ms", "stands_ms", "answer_ms")
        ]
        codes = ", ".join(str(code) for code in sorted({sample.status for sample in self.samples}))
        return f"{self.name:<24}{len(self.samples):>4}   {'   '.join(columns)}   {codes}"


HEADER = f"{'':<24}{'n':>4}   stop p50 p99    own p50 p99   used p50 p99   stands p50 p99  answer p50 p99   status (ms)"


def used_and_waited_ms(pid: int) -> tuple[float, float]:
    """Processor time of the main thread of a process, and how long it was ready to run and had no processor."""
    used, waited, _ = map(int, Path(f"/proc/{pid}/task/{pid}/schedstat").read_text().split())
    return used / 1e6, waited / 1e6


async def wait_until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(MAX_WAIT_S):
        while not condition():  # noqa: ASYNC110 - the cell has no events
            await asyncio.sleep(0.001)


@dataclass
class Plant:
    """The mock cell, and a daemon at `client`."""

    cell: MockCell
    client: httpx.AsyncClient
    way: str
    daemon_pid: int

    def stopped(self) -> bool:
        controller = self.cell.controller
        return not (controller.panel.program_running if self.way == "rws" else controller.armed)

    async def start_and_abort(self, viewers: int = 0) -> Sample:
        """Start a run, with `viewers` the floods, too, and abort the run while the arm moves."""
        run = await self._start()
        if not viewers:
            return await self._abort(run)
        module = ("-m", "benchmarks.daemon.floods", str(self.client.base_url.port), str(viewers))
        flood = await asyncio.create_subprocess_exec(
            sys.executable, *module, stdout=asyncio.subprocess.PIPE, start_new_session=True
        )  # Linux gives each session the same share of the processor, whatever the niceness of its processes
        try:
            assert flood.stdout is not None
            await flood.stdout.readline()
            return await self._abort(run)
        finally:
            os.killpg(flood.pid, signal.SIGKILL)
            await flood.wait()

    async def _abort(self, run: dict[str, Any]) -> Sample:
        await wait_until(
            lambda: (
                self.cell.controller.arm.is_moving_at(self.cell.controller.robot_s(self.cell.clock()))
                and self.cell.controller.armed
            )
        )
        if self.way == "rws":
            self.cell.inject_fault("link-half-open")
        began_s, (used_ms, waited_ms) = time.perf_counter(), used_and_waited_ms(self.daemon_pid)
        aborting = asyncio.create_task(self.client.post(f"/runs/{run['id']}/abort"))
        await wait_until(self.stopped)
        stop_s, (used_then_ms, waited_then_ms) = time.perf_counter(), used_and_waited_ms(self.daemon_pid)
        await wait_until(
            lambda: not self.cell.controller.arm.is_moving_at(self.cell.controller.robot_s(self.cell.clock()))
        )
        stands_s = time.perf_counter()
        answer = await aborting
        answer_s = time.perf_counter()
        if self.way == "rws":
            self.cell.clear_faults("link-half-open")
            self.cell.controller.run_program(True, self.cell.clock())
            self.cell.nudge()
        stop_ms, stands_ms, answer_ms = (1e3 * (at_s - began_s) for at_s in (stop_s, stands_s, answer_s))
        own_ms = stop_ms - (waited_then_ms - waited_ms)
        return Sample(stop_ms, own_ms, used_then_ms - used_ms, stands_ms, answer_ms, answer.status_code)

    async def _start(self) -> dict[str, Any]:
        async with asyncio.timeout(MAX_WAIT_S):
            while (answer := await self.client.post("/calibrate")).status_code != 202:
                if not self.cell.controller.panel.program_running:  # the stop was repeated until the arm stood
                    self.cell.controller.run_program(True, self.cell.clock())
                await asyncio.sleep(0.1)
        run: dict[str, Any] = answer.json()
        return run


@contextlib.asynccontextmanager
async def plant(way: str, folder: Path) -> AsyncIterator[Plant]:
    cell = MockCell(CellTruth.from_seed(SEED), program="python")
    try:
        rws = (0, 0) if way == "rws" else None
        announcement = (await cell.start(Ports(serial=way == "serial", rws=rws))).document()
        announcement |= {name: announcement[name] for name in ("camera", "scanner")}
        settings = folder / "handeyed.toml"
        settings.write_text(_settings(announcement, way))
        started = asyncio.to_thread(_enter, start_child("daemon", ["daemon.cli", "serve", str(settings)], folder))
        child, leave = await started
        try:
            async with httpx.AsyncClient(
                base_url=child.announcement["url"], timeout=MAX_WAIT_S, limits=NEW_CONNECTIONS
            ) as client:
                yield Plant(cell, client, way, child.announcement["pid"])
        finally:
            await asyncio.to_thread(leave)
    finally:
        await cell.close()


def _enter(context: Any) -> tuple[Any, Callable[[], None]]:
    return context.__enter__(), lambda: context.__exit__(None, None, None)


def _settings(announcement: dict[str, Any], way: str) -> str:
    text = settings_text(announcement, 0).replace("speed_mm_s = 250.0", f"speed_mm_s = {SPEED_MM_S:g}")
    robot = announcement["robot"]
    if way == "serial":
        text = text.replace(f"tcp://{robot['host']}:{robot['port']}", f"serial://{robot['serial']}")
    if way == "rws":
        host = announcement["rws"]["2.0"].partition("//")[2]
        text = text.replace("[robot]\n", f'[robot]\nstop_address = "rws://{host}"\n')
    return add_taught_poses(text, SEED)


async def measure(way: str, aborts: int, viewers: int, out: Callable[[str], None]) -> bool:
    """Measure one way, alone and beside the floods; returns whether the second meets the bar."""
    with tempfile.TemporaryDirectory(prefix="handeyed-abort-") as folder:
        async with plant(way, Path(folder)) as here:
            alone, beside = Row(f"{way}, alone"), Row(f"{way}, beside the floods")
            for _ in range(aborts):
                alone.samples.append(await here.start_and_abort())
            out(alone.text())
            while len(beside.samples) < aborts:
                with contextlib.suppress(TimeoutError):  # the run failed beside the floods before it was aborted
                    beside.samples.append(await here.start_and_abort(viewers))
            out(beside.text())
    return all(sample.stop_ms < BAR_MS for sample in beside.samples)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--aborts", type=int, default=30, help="for each row")
    parser.add_argument("--viewers", type=int, default=1500)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    options = parser.parse_args()
    print(HEADER)
    met = [
        asyncio.run(measure(way, options.aborts, options.viewers, lambda line: print(line, flush=True)))
        for way in options.ways
    ]
    print(f"bar: stop p99 below {BAR_MS:g} ms beside the floods: {'met' if all(met) else 'MISSED'}")
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
