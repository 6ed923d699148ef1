"""What the first look at a large scan costs: `python -m benchmarks.daemon.page_cloud`.

A mock cell and a daemon as processes, calibrated; a scan of `--points` points in `--views` views is sent to it, and the
page opened on the scan. Reported are the bytes of all answers until the finer cloud is shown, the time until the first
and the finer one, and by how much the daemon's resident memory grew at most meanwhile. The part is a bumpy plate of
`--area` square metres: with 2 the clouds are as fine as the page aims for, with 200 they are limited by their number.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
from playwright.sync_api import Response, sync_playwright

from benchmarks.daemon.page import CHROMIUM, RENDERER, run_s
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text
from registration.io.formats import ply
from registration.points.layout import XYZ_FLOAT32

SEED = 7
BLOCK = 1 << 18
FETCHED_BAR_BYTES, GROWTH_BAR_MB = 12e6, 300.0
LOOK_LIMIT_S = 600.0


def cloud(points: int, area_m2: float, seed: int) -> Iterator[bytes]:
    """A PLY file of a bumpy plate, seen from above, mm."""
    random, side_mm = np.random.default_rng(seed), 1000.0 * np.sqrt(area_m2)
    yield ply.format_header(XYZ_FLOAT32, points)
    for start in range(0, points, BLOCK):
        x, y = random.uniform(-side_mm / 2, side_mm / 2, (2, min(BLOCK, points - start)))
        z = 600 + 15 * np.sin(x / 60) * np.cos(y / 45) + random.normal(0, 0.03, len(x))
        yield np.column_stack([x, y, z]).astype("<f4").tobytes()


def send_scan(client: httpx.Client, points: int, views: int, area_m2: float) -> str:
    """Id of a scan whose views share the points, each of the whole plate."""
    scan: str = client.post("/scans", json={"name": "plate"}).raise_for_status().json()["id"]
    for view in range(views):
        body = cloud(points // views, area_m2, view)
        sent = client.post(f"/scans/{scan}/views", params={"pose": "now"}, content=body,
                           headers={"Content-Type": "application/x-ply"})  # fmt: skip
        sent.raise_for_status()
    return scan


def resident_mb(pid: int, name: str) -> float:
    """VmRSS, or VmHWM: the most since `forget_peak`."""
    line = next(line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) / 1024


def forget_peak(pid: int) -> None:
    Path(f"/proc/{pid}/clear_refs").write_text("5")


def look(url: str, scan: str) -> tuple[list[float], int, int]:
    """Seconds until each whole cloud was there, number of answers, and bytes of all of them."""
    began_s, arrived, sizes = time.monotonic(), list[float](), list[int]()

    def on_response(answer: Response) -> None:
        if "/live" in answer.url or "/events" in answer.url:
            return
        answer.finished()
        sizes.append(answer.request.sizes()["responseBodySize"])
        if "/cloud?" in answer.url:
            arrived.append(time.monotonic() - began_s)

    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=[*RENDERER, "--no-sandbox"])
        page = browser.new_page()
        page.on("response", on_response)
        page.goto(f"{url}/page/?lang=en#/scans/{scan}")
        quiet_s, seen = 0.0, 0
        while quiet_s < 20 and time.monotonic() - began_s < LOOK_LIMIT_S:
            page.wait_for_timeout(1000)
            quiet_s, seen = (quiet_s + 1, seen) if seen == len(sizes) else (0.0, len(sizes))
        browser.close()
    return arrived, len(sizes), sum(sizes)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=float, default=1e7)
    parser.add_argument("--views", type=int, default=10)
    parser.add_argument("--area", type=float, nargs="+", default=[2.0, 200.0], help="square metres of the plate")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="handeyed-page-") as name:
        folder = Path(name)
        with start_child("mock-cell", ["mock_robot", "run", "--with-parent", "--seed", str(SEED)], folder) as cell:
            (folder / "handeyed.toml").write_text(settings_text(cell.announcement, 0))
            with start_child("daemon", ["daemon.cli", "serve", str(folder / "handeyed.toml")], folder) as daemon:
                url, pid = daemon.announcement["url"], daemon.process.pid
                met = [measure(url, pid, int(options.points), options.views, area) for area in options.area]
                return int(not all(met))


def measure(url: str, pid: int, points: int, views: int, area_m2: float) -> bool:
    """Print the figures of one part; whether both bars are met."""
    with httpx.Client(base_url=url, timeout=300) as client:
        if client.get("/calibrations/current").status_code == 404:
            run_s(client)
        scan = send_scan(client, points, views, area_m2)
    forget_peak(pid)
    before_mb = resident_mb(pid, "VmRSS")
    arrived, answers, fetched = look(url, scan)
    growth_mb = resident_mb(pid, "VmHWM") - before_mb
    print(f"{points:.0e} points in {views} views of {area_m2:g} m2: {fetched / 1e6:.1f} MB in {answers} answers "
          f"(bar {FETCHED_BAR_BYTES / 1e6:.0f} MB), first cloud after {arrived[views - 1]:.1f} s, "
          f"the last after {arrived[-1]:.1f} s; the daemon grew by {growth_mb:.0f} MB to "
          f"{before_mb + growth_mb:.0f} MB (bar {GROWTH_BAR_MB:.0f} MB more)", flush=True)  # fmt: skip
    return len(arrived) >= views and fetched <= FETCHED_BAR_BYTES and growth_mb <= GROWTH_BAR_MB


if __name__ == "__main__":
    sys.exit(main())
