"""Time of a verification beside readers: `python -m benchmarks.daemon.readers --readers 1000`.

A mock cell, the daemon, and the readers as processes. Verifications alone and beside the readers alternate, so that a
busy machine slows both; printed is the ratio of the medians. Poses are taught, so that every verification moves the
same way. Each reader asks for one document after the other, once a period: a third reads the answers, a third hangs up
at once, a third reads slowly. Their process has the lowest priority: in a plant they are on other machines.
"""

import argparse
import asyncio
import contextlib
import multiprocessing
import os
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx

from benchmarks.daemon.taught_poses import add_taught_poses
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text

RATIO_BAR = 1.02
SEED = 7
PATHS = ("/robot", "/ready", "/camera/frame.png", "/runs?limit=500", "/calibrate", "/drift", "/health")
SLOW_BYTES, SLOW_S = 4096, 0.5
"""What a slow reader takes at a time, and how long it waits before the next."""


def read_for_ever(url: str, count: int, period_s: float) -> None:
    """The process of `count` readers."""
    os.nice(19)
    asyncio.run(_read_all(url, count, period_s))


async def _read_all(url: str, count: int, period_s: float) -> None:
    await asyncio.gather(*(_read(url, reader, period_s) for reader in range(count)))


async def _read(url: str, reader: int, period_s: float) -> None:
    address, chance = urlsplit(url), random.Random(reader)
    await asyncio.sleep(chance.uniform(0, period_s))
    while True:
        began_s = time.monotonic()
        with contextlib.suppress(OSError, TimeoutError):
            request = f"GET {chance.choice(PATHS)} HTTP/1.1\r\nHost: {address.netloc}\r\nConnection: close\r\n\r\n"
            async with asyncio.timeout(max(period_s, 10.0)):
                await _ask(address.hostname or "", address.port or 0, request.encode(), reader % 3)
        await asyncio.sleep(max(0.0, period_s - (time.monotonic() - began_s)))


async def _ask(host: str, port: int, request: bytes, manner: int) -> None:
    """`manner` 0: read the answer, 1: hang up, 2: read it slowly."""
    reader, writer = await asyncio.open_connection(host, port, limit=SLOW_BYTES)
    try:
        writer.write(request)
        while manner != 1 and await reader.read(SLOW_BYTES):
            if manner == 2:
                await asyncio.sleep(SLOW_S)
    finally:
        writer.close()


@contextlib.contextmanager
def readers_at(url: str, count: int, period_s: float) -> Iterator[None]:
    """The readers, for the block."""
    process = multiprocessing.get_context("spawn").Process(target=read_for_ever, args=(url, count, period_s))
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def verification_s(client: httpx.Client) -> float:
    """Seconds of one verification."""
    began_s = time.monotonic()
    answer = client.post("/verify", params={"wait": 120})
    if not answer.is_success or (run := answer.json())["state"] != "finished":
        raise SystemExit(f"no verification: {answer.text if not answer.is_success else run['cause']}")
    return time.monotonic() - began_s


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--readers", type=int, default=1000)
    parser.add_argument("--period", type=float, default=10.0, help="seconds between a reader's requests")
    parser.add_argument("--rounds", type=int, default=10)
    options = parser.parse_args()
    alone_s: list[float] = []
    beside_s: list[float] = []
    with tempfile.TemporaryDirectory(prefix="handeyed-readers-") as name:
        folder = Path(name)
        mock = ["mock_robot", "run", "--with-parent", "--seed", str(SEED), "--time-scale", "1"]
        with start_child("mock-cell", mock, folder) as robot:
            (folder / "handeyed.toml").write_text(add_taught_poses(settings_text(robot.announcement, 0), SEED))
            with start_child("daemon", ["daemon.cli", "serve", str(folder / "handeyed.toml")], folder) as daemon:
                url = daemon.announcement["url"]
                with httpx.Client(base_url=url, timeout=200, trust_env=False) as client:
                    client.post("/calibrate?wait=180").raise_for_status()
                    for _ in range(options.rounds):
                        alone_s.append(verification_s(client))
                        with readers_at(url, options.readers, options.period):
                            time.sleep(min(options.period, 5.0))
                            beside_s.append(verification_s(client))
    ratio = statistics.median(beside_s) / statistics.median(alone_s)
    print(f"{options.readers} readers, each asking every {options.period:g} s; {options.rounds} verifications of each:")
    print(f"alone                {statistics.median(alone_s):6.2f} s median, slowest {max(alone_s):.2f} s")
    print(f"beside the readers   {statistics.median(beside_s):6.2f} s median, slowest {max(beside_s):.2f} s")
    print(f"ratio {ratio:.3f} (bar {RATIO_BAR:g}); load {os.getloadavg()[0]:.0f} on {os.cpu_count()} cores")
    return 0 if ratio < RATIO_BAR else 1


if __name__ == "__main__":
    sys.exit(main())
