"""What a merge costs the daemon and a run beside it: `python -m benchmarks.daemon.merge_beside`.

A mock cell and a daemon as processes; a scan of `--points` points in `--views` views is merged, every point and in
voxels of 1 mm. Reported is the most resident memory of the daemon meanwhile (bar 600 MB), and how much longer a
calibration takes while one merge follows another. Runs of a cell differ by what its noise shows: the first of a fresh
cell beside merges is compared with the first of another alone, and so on. On a busy machine that says little. The
viewer, who sits elsewhere in a plant, has the lowest priority.
"""

import argparse
import os
import sys
import tempfile
import threading
from pathlib import Path

import httpx
import numpy as np

from benchmarks.daemon.page import run_s
from benchmarks.daemon.page_cloud import SEED, forget_peak, resident_mb, send_scan
from daemon.cli.demo_run.processes import start_child
from daemon.cli.demo_run.scenario import settings_text

MERGES = {"every point": {}, "voxels of 1 mm": {"voxel_mm": 1.0}}
BAR_MB, RUN_BAR = 600.0, 0.02


def merge(client: httpx.Client, scan: str, how: dict[str, float]) -> None:
    """The merged cloud, read and dropped."""
    headers = {"Accept": "application/x-ply"}
    with client.stream("GET", f"/scans/{scan}/cloud", params=how, headers=headers) as answer:
        answer.raise_for_status()
        for _ in answer.iter_raw():
            pass


def peak_mb(client: httpx.Client, pid: int, scan: str, how: dict[str, float]) -> float:
    """The most resident memory of the daemon during one merge."""
    forget_peak(pid)
    merge(client, scan, how)
    return resident_mb(pid, "VmHWM")


def run_beside_s(client: httpx.Client, url: str, scan: str, how: dict[str, float]) -> float:
    """Duration of a calibration while merges follow one another."""
    over = threading.Event()

    def go_on() -> None:
        os.nice(19)  # of this thread, as Linux's nice(2)
        with httpx.Client(base_url=url, timeout=300) as viewer:
            while not over.is_set():
                merge(viewer, scan, how)

    viewer = threading.Thread(target=go_on)
    viewer.start()
    try:
        return run_s(client)
    finally:
        over.set()
        viewer.join()


def seconds_of_runs(options: argparse.Namespace, peaks: dict[str, float] | None) -> list[float]:
    """Durations of `--runs` calibrations of a fresh cell; with `peaks`, which it fills, beside merges."""
    with tempfile.TemporaryDirectory(prefix="handeyed-merge-") as name:
        folder = Path(name)
        with start_child("mock-cell", ["mock_robot", "run", "--with-parent", "--seed", str(SEED)], folder) as cell:
            (folder / "handeyed.toml").write_text(settings_text(cell.announcement, 0))
            with (
                start_child("daemon", ["daemon.cli", "serve", str(folder / "handeyed.toml")], folder) as daemon,
                httpx.Client(base_url=daemon.announcement["url"], timeout=300) as client,
            ):
                url, pid = daemon.announcement["url"], daemon.process.pid
                run_s(client)
                before_mb = resident_mb(pid, "VmRSS")
                scan = send_scan(client, int(options.points), options.views, 2.0)
                if peaks is None:
                    return [run_s(client) for _ in range(options.runs)]
                for what, how in MERGES.items():
                    peaks[what] = peak_mb(client, pid, scan, how)
                    print(
                        f"{what}: {peaks[what]:.0f} MB at most, {before_mb:.0f} MB before (bar {BAR_MB:.0f} MB)",
                        flush=True,
                    )
                return [run_beside_s(client, url, scan, MERGES["voxels of 1 mm"]) for _ in range(options.runs)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=float, default=4.5e6)
    parser.add_argument("--views", type=int, default=24)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    peaks: dict[str, float] = {}
    beside_s, alone_s = np.array(seconds_of_runs(options, peaks)), np.array(seconds_of_runs(options, None))
    slower = float(np.median(beside_s / alone_s)) - 1 if options.runs else 0.0
    for name, seconds in (("alone", alone_s), ("beside merges", beside_s)):
        print(f"runs {name}: " + " ".join(f"{one:.1f}" for one in seconds) + " s")
    print(f"a run takes {slower:+.1%} beside merges, median (bar {RUN_BAR:.0%})")
    return int(max(peaks.values()) > BAR_MB or slower > RUN_BAR)


if __name__ == "__main__":
    sys.exit(main())
