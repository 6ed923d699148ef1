"""The CB link with the shipped RAPID over real sockets: fault schedules, read rate, reconnects.

`python -m benchmarks.daemon.link [--schedules N] [--reads S] ...`

Schedules: benchmarks/daemon/link_schedules.py. Reads: poses at 250 Hz while a cloud of ten million points passes
through the same process. Reconnects: a greeting and a BYE each, with the resources they leave behind.
"""

import argparse
import asyncio
import gc
import json
import os
import sys
import threading
import time
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import numpy as np

from benchmarks.daemon.link_schedules import CELLS, schedules
from drivers.robots.abb.cb_robot import CbRobot
from drivers.transports.tcp import TcpTransport
from mock_robot.cell import MockCell, Ports
from mock_robot.truth.truth import CellTruth
from registration.io.stream import CloudStream

READS_A_SECOND = 250
POINTS = 10_000_000


@asynccontextmanager
async def cell_process(program: str) -> AsyncIterator[int]:
    """A mock cell in a process of its own; yields its robot's port."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "mock_robot", "run", "--with-parent", "--robot-only", "--controller", program,
        stdin=PIPE, stdout=PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        yield int(json.loads(await process.stdout.readline())["robot"]["port"])
    finally:
        process.terminate()
        await process.wait()


async def reads(seconds: float, program: str) -> list[float]:
    """Duration in ms of each of 250 reads per second, while clouds pass through another thread of this process.

    A read without an answer raises, so no read of the result was lost.
    """
    async with cell_process(program) as port:
        robot = CbRobot(TcpTransport("127.0.0.1", port))
        robot.start()
        await robot.wait_for_link(10.0)
        try:
            with beside(register_until):
                taken_ms, took_s = await _read_for(robot, seconds)
        finally:
            await robot.close()
    print(f"reads ({program}): {len(taken_ms)} poses in {took_s:.1f} s, none lost", flush=True)
    return taken_ms


async def _read_for(robot: CbRobot, seconds: float) -> tuple[list[float], float]:
    taken_ms: list[float] = []
    began_s = time.monotonic()
    while (due_s := began_s + len(taken_ms) / READS_A_SECOND) < began_s + seconds:
        await asyncio.sleep(max(0.0, due_s - time.monotonic()))
        asked_s = time.monotonic()
        await robot.read_pose()
        taken_ms.append(1e3 * (time.monotonic() - asked_s))
    return taken_ms, time.monotonic() - began_s


@contextmanager
def beside(work: Callable[[threading.Event], object]) -> Iterator[None]:
    """Run work in another thread of this process until the event is set."""
    over = threading.Event()
    thread = threading.Thread(target=work, args=(over,))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def register_until(over: threading.Event) -> None:
    """Pass clouds through in pieces, as the daemon does."""
    piece = np.zeros((100_000, 3), np.float32).tobytes()
    while not over.is_set():
        stream = CloudStream.of_body("application/octet-stream", np.eye(4), "mm")
        for _ in range(POINTS // 100_000):
            for _part in stream.parts(piece):
                pass
            if over.is_set():
                return
        list(stream.last_parts())


async def reconnects(count: int) -> str:
    """Connect and disconnect; descriptors and resident memory before and after."""
    cell = MockCell(CellTruth.from_seed(7), program="rapid")
    try:
        wire = await cell.start(Ports(devices=None))
        assert wire.robot_port is not None
        await _connect(wire.robot_port, count // 10)  # fills caches and arenas
        before = _resources()
        await _connect(wire.robot_port, count)
        after = _resources()
    finally:
        await cell.close()
    return (
        f"reconnects: {count}; descriptors {before[0]} before, {after[0]} after; "
        f"memory {before[1]:.1f} MB before, {after[1]:.1f} MB after"
    )


async def _connect(port: int, count: int) -> None:
    for _ in range(count):
        robot = CbRobot(TcpTransport("127.0.0.1", port))
        robot.start()
        await robot.wait_for_link(30.0)
        await robot.close()


def _resources() -> tuple[int, float]:
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return len(os.listdir("/proc/self/fd")), pages * os.sysconf("SC_PAGE_SIZE") / 1e6  # noqa: PTH208


def main() -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.daemon.link", description=__doc__.splitlines()[0])
    parser.add_argument("--schedules", type=int, default=60, help="random fault schedules (1000 for the long run)")
    parser.add_argument(
        "--reads", type=float, default=5.0, metavar="S", help="seconds of reading (60 for the long run)"
    )
    parser.add_argument("--reconnects", type=int, default=300, help="connections (10000 for the long run)")
    parser.add_argument("--cells", type=int, default=CELLS, help="side by side; many of them are a busy machine")
    parser.add_argument("--seed", type=int, default=1, help="of the schedules")
    parser.add_argument("--hectic", action="store_true", help="threads take turns a thousand times as often")
    options = parser.parse_args()
    failed = False
    if options.hectic:
        sys.setswitchinterval(5e-6)
    if options.schedules:
        tally = asyncio.run(schedules(options.schedules, options.seed, options.cells))
        print(tally.summary(), flush=True)
        failed = tally.has_failures
    if options.reads:
        for program in ("rapid", "python"):
            taken_ms = np.array(asyncio.run(reads(options.reads, program)))
            shares = ", ".join(f"{share:g} % under {np.percentile(taken_ms, share):.1f} ms" for share in (50, 99, 99.9))
            print(f"  {shares}", flush=True)
    if options.reconnects:
        print(asyncio.run(reconnects(options.reconnects)))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
