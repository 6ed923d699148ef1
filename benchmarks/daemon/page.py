"""What the page costs: `python -m benchmarks.daemon.page --lighthouse node_modules/.bin/lighthouse`.

A mock cell and a daemon as processes, calibrated. Reported are, for each screen, Lighthouse's scores, first paint and
layout shift in Debian's Chromium (`npm install lighthouse@12`; left out without it); the bytes of `GET /live` in an
idle minute; and the time of calibration runs, in real time and at taught poses, with the page open beside that of runs
without it, by turns. That browser draws without a graphics card, and has the lowest priority: in a plant it is on
another machine, or has a card. The daemon's processor time of each run is told, too: other work on the machine takes
none of it.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from benchmarks.daemon.taught_poses import add_taught_poses
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text

SEED = 7
CHROMIUM = "/usr/bin/chromium"
RENDERER = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PLACES = (
    "cell", "calibrate", "run", "result", "jog", "verify", "scans", "devices", "history", "audit", "settings", "help",
)  # fmt: skip
CATEGORIES = {"performance": 90, "accessibility": 100, "best-practices": 100}
"""Of Lighthouse, with the least score of each screen."""

FIRST_PAINT_BAR_S, LAYOUT_SHIFT_BAR, LIVE_BAR_BYTES_S, RUN_BAR = 1.0, 0.1, 2000.0, 1.02


def judge(lighthouse: str, url: str, place: str) -> dict[str, float]:
    """Scores from 0 to 100, first paint in seconds and layout shift of one screen, as Lighthouse gives them."""
    flags = " ".join(["--headless=new", *RENDERER, *([] if os.geteuid() else ["--no-sandbox"])])
    environment = {**os.environ, "CHROME_PATH": CHROMIUM}
    asked = [lighthouse, f"{url}/page/?lang=en#/{place}", "--quiet", "--output=json", "--preset=desktop"]
    asked += [f"--only-categories={','.join(CATEGORIES)}", f"--chrome-flags={flags}"]
    with tempfile.NamedTemporaryFile(suffix=".json") as written:  # through a pipe it ends after 64 KiB now and then
        asked += [f"--output-path={written.name}"]
        answer = subprocess.run(asked, check=False, capture_output=True, text=True, env=environment)
        if answer.returncode:
            raise SystemExit(f"lighthouse failed on {place}: {answer.stderr[-500:]}")
        report: dict[str, Any] = json.loads(Path(written.name).read_text())
    audits = report["audits"]
    return {
        **{name: 100 * report["categories"][name]["score"] for name in CATEGORIES},
        "paint_s": audits["first-contentful-paint"]["numericValue"] / 1000,
        "shift": audits["cumulative-layout-shift"]["numericValue"],
        "blocked_ms": audits["total-blocking-time"]["numericValue"],
    }


def live_bytes_s(url: str, seconds: float) -> float:
    """Bytes a second of `GET /live` while nothing happens."""
    began_s, count = time.monotonic(), 0
    with httpx.stream("GET", f"{url}/live", timeout=60) as answer:
        for part in answer.iter_raw():
            count += len(part)
            if time.monotonic() - began_s > seconds:
                break
    return count / (time.monotonic() - began_s)


def run_s(client: httpx.Client) -> float:
    """Seconds of one calibration run."""
    began_s = time.monotonic()
    run = client.post("/calibrate", params={"wait": 300}).raise_for_status().json()
    if run["state"] != "finished":
        raise SystemExit(f"the run did not finish: {run['cause'] or run['state']}")
    return time.monotonic() - began_s


def run_and_work_s(client: httpx.Client, daemon: int) -> tuple[float, float]:
    """Seconds of one calibration run, and of the processor in the daemon's process meanwhile."""
    worked_s = processor_s(daemon)
    return run_s(client), processor_s(daemon) - worked_s


def worked(rows: list[tuple[float, float]]) -> str:
    """The second of each row."""
    return "/".join(f"{each:.2f}" for _, each in rows)


def processor_s(pid: int) -> float:
    """Processor time of a process and of its children that have ended, user and system, s: proc(5)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def open_page(url: str) -> Iterator[None]:
    """The page of the cell in a window, after its first beat."""
    from playwright.sync_api import sync_playwright

    sandbox = [] if os.geteuid() else ["--no-sandbox"]
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=[*RENDERER, *sandbox])
        page = browser.new_page()
        page.goto(f"{url}/page/?lang=en#/run")
        page.wait_for_timeout(3000)
        yield
        browser.close()


def tell_screens(lighthouse: str, url: str) -> bool:
    """Print a row for each screen; whether all bars are met."""
    met = True
    columns = ("performance", "accessibility", "best practices", "first paint", "shift", "blocked")
    print(f"{'screen':<10}" + "".join(f"{column:>16}" for column in columns))
    for place in PLACES:
        row = judge(lighthouse, url, place)
        met &= all(row[name] >= bar for name, bar in CATEGORIES.items())
        met &= row["paint_s"] <= FIRST_PAINT_BAR_S and row["shift"] <= LAYOUT_SHIFT_BAR
        values = [f"{row[name]:.0f}" for name in CATEGORIES]
        values += [f"{row['paint_s']:.2f} s", f"{row['shift']:.3f}", f"{row['blocked_ms']:.0f} ms"]
        print(f"{place:<10}" + "".join(f"{value:>16}" for value in values))
    print(f"bars: {', '.join(f'{name} {bar}' for name, bar in CATEGORIES.items())}, "
          f"first paint {FIRST_PAINT_BAR_S:g} s, shift {LAYOUT_SHIFT_BAR:g}")  # fmt: skip
    return met


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lighthouse", help="the program of npm's lighthouse")
    parser.add_argument("--runs", type=int, default=7, help="calibration runs with the page, and as many without")
    parser.add_argument("--idle", type=float, default=60.0, help="seconds of GET /live")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="handeyed-page-") as name:
        folder = Path(name)
        mock = ["mock_robot", "run", "--with-parent", "--seed", str(SEED), "--time-scale", "1"]
        with start_child("mock-cell", mock, folder) as cell:
            (folder / "handeyed.toml").write_text(add_taught_poses(settings_text(cell.announcement, 0), SEED))
            with start_child("daemon", ["daemon.cli", "serve", str(folder / "handeyed.toml")], folder) as daemon:
                url, pid = daemon.announcement["url"], daemon.announcement["pid"]
                return int(not measure(url, pid, options.lighthouse, options.runs, options.idle))


def measure(url: str, daemon: int, lighthouse: str | None, runs: int, idle_s: float) -> bool:
    """Print the figures of a daemon; whether all bars are met. From then on this process has the lowest priority."""
    os.nice(19)
    with httpx.Client(base_url=url, timeout=300) as client:
        run_s(client)
        rate = live_bytes_s(url, idle_s)
        print(f"GET /live idle for {idle_s:.0f} s: {rate:.0f} bytes a second (bar {LIVE_BAR_BYTES_S:.0f})")
        alone, beside = [], []
        for _ in range(runs):
            alone.append(run_and_work_s(client, daemon))
            with open_page(url):
                beside.append(run_and_work_s(client, daemon))
    (alone_s, worked_s), (beside_s, worked_beside_s) = (
        [statistics.median(column) for column in zip(*rows, strict=True)] for rows in (alone, beside)
    )
    ratio, share = beside_s / alone_s, (worked_beside_s - worked_s) / alone_s
    print(f"a calibration run: {alone_s:.2f} s, with the page open {beside_s:.2f} s, "
          f"ratio {ratio:.3f} (bar {RUN_BAR:g}; medians of {runs} by turns)")  # fmt: skip
    print(f"of the processor in the daemon: {worked_s:.2f} s a run, with the page open {worked_beside_s:.2f} s, "
          f"{share:+.1%} of a run's time; each run: {worked(alone)}, {worked(beside)}")  # fmt: skip
    met = rate <= LIVE_BAR_BYTES_S and ratio <= RUN_BAR
    if lighthouse:
        met &= tell_screens(lighthouse, url)
    print(f"load {os.getloadavg()[0]:.0f} on {os.cpu_count()} cores")
    return met


if __name__ == "__main__":
    sys.exit(main())
