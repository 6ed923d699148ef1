"""kill -9 repeatedly, at random and at every failpoint: `python -m benchmarks.daemon.torture --rounds 1000`.

Each round starts a daemon on the store of the last one, checks that everything acknowledged is there and nothing is
half there, repeats the request that got no answer, continues, and is killed. Devices are fakes; server, store, files
and failpoints are real. kill -9 keeps the system's buffers; losses as by a power cut are tested by `python -m
benchmarks.daemon.disk_faults`, the time until a new process is ready by `python -m benchmarks.daemon.restart`.
"""

import argparse
import random
import shutil
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.daemon.torture.ledger import Lost
from tests.daemon.torture.torture import Torture, TortureReport

READY_BAR_S = 5.0


def run_torture(rounds: int, seed: int, stopped: threading.Event) -> TortureReport:
    """Run one torture, in a folder that is kept when something was lost."""
    folder = Path(tempfile.mkdtemp(prefix="handeyed-torture-"))
    torture = Torture(folder, random.Random(seed))
    try:
        while torture.report.rounds < rounds and not stopped.is_set():
            torture.round(torture.report.rounds)
    except Lost as lost:
        torture.report.lost = f"seed {seed}, round {torture.report.rounds}: {lost}\nthe store is left in {folder}"
        stopped.set()
        return torture.report
    shutil.rmtree(folder)
    return torture.report


def report(reports: list[TortureReport], took_s: float) -> None:
    """Print the reports."""
    killed = sum((one.killed for one in reports), Counter[str]())
    ready_s = [seconds for one in reports for seconds in one.ready_s]
    print(f"{sum(one.rounds for one in reports)} rounds in {took_s:.0f} s:"
          " nothing lost, nothing half done, the arm never moved by itself")  # fmt: skip
    for place, count in sorted(killed.items()):
        print(f"  killed {place:<44}{count:6}")
    middle, slowest = statistics.median(ready_s), max(ready_s)
    print(f"ready again, forked: median {middle:.2f} s, slowest {slowest:.2f} s (bar {READY_BAR_S:g} s)")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--side-by-side", type=int, default=2, help="tortures at a time, each with its own store")
    options = parser.parse_args()
    lanes, stopped, began_s = options.side_by_side, threading.Event(), time.monotonic()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    shares = [options.rounds // lanes + (lane < options.rounds % lanes) for lane in range(lanes)]
    with ThreadPoolExecutor(lanes) as threads:
        seeds = range(options.seed, options.seed + lanes)
        reports = list(threads.map(run_torture, shares, seeds, [stopped] * lanes))
    lost = [one.lost for one in reports if one.lost]
    print("\n".join(lost), end="")
    if not lost:
        report(reports, time.monotonic() - began_s)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
