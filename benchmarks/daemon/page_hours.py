"""A day of an open page, compressed: `python -m benchmarks.daemon.page_hours --hours 24 --speed 60`.

A daemon with fake devices in a process of its own, whose beat of `GET /live` comes SPEED times a second, and
Debian's Chromium under Playwright with the page's ticks as much shorter. Between the beats of each hour the arm
moves, clouds are registered, the cell is verified, and a person walks through every screen. At the end of each hour:
the tab's heap after a collection, its nodes and listeners, and the daemon's allocated blocks and resident memory. A
slope is fitted to each after the first quarter, and its growth over the hours is told beside its standard error.
"""

import argparse
import asyncio
import gc
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import numpy as np

from benchmarks.daemon.http import process
from benchmarks.daemon.http_fuzz import resident_mb

BEATS_AN_HOUR = 3600
WARM_UP = 0.25
MAX_GROWTH = 0.05
"""Of the median, over all hours; what is within two standard errors of zero is not growth."""

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PLACES = (
    "calibrate",
    "run",
    "result",
    "jog",
    "verify",
    "scans",
    "devices",
    "history",
    "audit",
    "settings",
    "help",
    "cell",
)
SHOWN_MS = 400
REGISTRATIONS = 5
POSE = "800,100,900,0,0.7071068,0.7071068,0"
COLUMNS = ("tab's heap, MB", "tab's nodes", "tab's listeners", "daemon's blocks, thousands", "daemon's memory, MB")

COUNT_BEATS = """
const every = window.setInterval;
window.setInterval = (act, ms, ...rest) => every(act, ms > 1000 ? ms : ms / SPEED, ...rest);
window.beats = 0;
new BroadcastChannel('handeyed-live').onmessage = ({ data }) => { window.beats += data.kind === 'live'; };
"""
"""Of a page that opens: its ticks SPEED times shorter, and the beats it was passed."""


def daemon_process(folder: str, speed: float, ready: Any) -> None:
    """The daemon with its real server and fake devices; puts its port, and writes its allocated blocks to a file."""
    import uvloop

    from daemon.api.live import live_feed

    live_feed.BEAT_S, live_feed.FAST_S = live_feed.BEAT_S / speed, live_feed.FAST_S / speed
    uvloop.run(_daemon(Path(folder), ready))


async def _daemon(folder: Path, ready: Any) -> None:
    from tests.daemon.cell_under_test import serving, settings_for

    settings = settings_for(folder / "store", calibration={"policy": "auto", "tolerance_mm": 20.0})
    async with serving(settings) as bench:
        answer = await bench.client.post("/calibrate", params={"wait": 120})
        answer.raise_for_status()
        ready.put(urlsplit(bench.url).port)
        still = bench.robot.base_T_flange.copy()
        turn = 0
        while True:
            await asyncio.sleep(1.0)
            turn += 1
            if not bench.robot.armed:  # somebody jogs it by hand
                bench.robot.base_T_flange = still.copy()
                bench.robot.base_T_flange[2, 3] += 10.0 * np.sin(turn)
            if (folder / "count").exists():
                gc.collect()
                (folder / "blocks").write_text(str(sys.getallocatedblocks()))
                (folder / "count").unlink()


def blocks_of(folder: Path) -> float:
    """Thousands of memory blocks that the daemon holds after a collection."""
    (folder / "count").touch()
    while (folder / "count").exists():
        time.sleep(0.1)
    return int((folder / "blocks").read_text()) / 1000


async def live(page: Any, client: httpx.AsyncClient, hour: int) -> None:
    """What people and machines do in one hour."""
    for _ in range(REGISTRATIONS):
        cloud = np.random.default_rng(hour).normal(size=(5000, 3)).astype(np.float32).tobytes()
        head = {"Content-Type": "application/octet-stream"}
        (await client.post("/register", params={"pose": POSE}, content=cloud, headers=head)).raise_for_status()
    (await client.post("/verify", params={"wait": 120})).raise_for_status()
    for place in PLACES:
        await page.evaluate("place => { location.hash = `#/${place}`; }", place)
        await page.wait_for_timeout(SHOWN_MS)


async def watch(port: int, pid: int, folder: Path, hours: int, speed: float) -> list[tuple[float, ...]]:
    """One row of COLUMNS for each hour."""
    from playwright.async_api import async_playwright

    rows: list[tuple[float, ...]] = []
    sandbox = [] if os.geteuid() else ["--no-sandbox"]
    async with (
        async_playwright() as started,
        httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=300) as client,
    ):
        browser = await started.chromium.launch(executable_path=CHROMIUM, args=[*ARGUMENTS, *sandbox])
        page = await browser.new_page()
        await page.add_init_script(COUNT_BEATS.replace("SPEED", str(speed)))
        await page.goto(f"http://127.0.0.1:{port}/page/?lang=en#/cell")
        devtools = await page.context.new_cdp_session(page)
        for hour in range(1, hours + 1):
            await live(page, client, hour)
            while await page.evaluate("window.beats") < hour * BEATS_AN_HOUR:
                await page.wait_for_timeout(500)
            await devtools.send("HeapProfiler.collectGarbage")
            heap = await devtools.send("Runtime.getHeapUsage")
            counters = await devtools.send("Memory.getDOMCounters")
            rows.append(
                (
                    heap["usedSize"] / 1e6,
                    counters["nodes"],
                    counters["jsEventListeners"],
                    await asyncio.to_thread(blocks_of, folder),
                    resident_mb(pid),
                )
            )
            if hour % 6 == 0 or hour == 1:
                print(
                    f"hour {hour:3}: "
                    + ", ".join(f"{name} {value:.1f}" for name, value in zip(COLUMNS, rows[-1], strict=True))
                )
        await browser.close()
    return rows


def growth(column: "np.ndarray[Any, np.dtype[np.float64]]") -> tuple[float, float]:
    """Growth from the first to the last row by a straight line, and its standard error; NaN for under four rows."""
    if len(column) < 4:
        return float("nan"), float("nan")
    (slope, _), covariance = np.polyfit(np.arange(len(column)), column, 1, cov=True)
    return float(slope) * len(column), float(np.sqrt(covariance[0, 0])) * len(column)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=int, default=24)
    parser.add_argument("--speed", type=float, default=60.0, help="how many beats a second, of one")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="handeyed-page-hours-"))
    began_s = time.monotonic()
    try:
        with process(daemon_process, str(folder), options.speed) as (port, pid):
            rows = np.array(asyncio.run(watch(port, pid, folder, options.hours, options.speed)))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(
        f"{options.hours} hours of beats in {(time.monotonic() - began_s) / 60:.0f} min; load {os.getloadavg()[0]:.0f}"
    )
    steady = rows[int(WARM_UP * len(rows)) :]
    grown = False
    for name, column in zip(COLUMNS, steady.T, strict=True):
        over, error = growth(column)
        middle = float(np.median(column))
        grown |= over > max(MAX_GROWTH * middle, 2 * error)
        found = f"growth {over:+7.2f} +- {error:.2f} over the last {len(column)} h (bar {MAX_GROWTH:.0%} of it)"
        print(f"{name:28} median {middle:8.1f}, {found if np.isfinite(over) else 'too few hours to tell its growth'}")
    return int(grown)


if __name__ == "__main__":
    sys.exit(main())
