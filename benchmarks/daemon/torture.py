"""kill -9 repeatedly, at random and at every failpoint: `python -m benchmarks.daemon.torture --rounds 1000`.

Each round starts a daemon on the store of the last one, checks that everything acknowledged is there and nothing is
half there, repeats the request that got no answer, continues, and is killed. Devices are fakes; server, store, files
and failpoints are real. kill -9 keeps the system's buffers; losses as by a power cut are tested by `python -m
benchmarks.daemon.disk_faults`, the time until a new process is ready by `python -m benchmarks.daemon.restart`.

Then the one model of tests/stories/one_model: `--histories` histories of everything that can happen at a cell, in any
order, each at a mock cell and with a daemon of its own.
"""

import argparse
import multiprocessing
import random
import shutil
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

from tests.daemon.torture.ledger import Lost
from tests.daemon.torture.torture import Torture, TortureReport
from tests.stories.one_model.model import run_histories

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
    if not ready_s:
        return  # only histories are asked for
    middle, slowest = statistics.median(ready_s), max(ready_s)
    print(f"ready again, forked: median {middle:.2f} s, slowest {slowest:.2f} s (bar {READY_BAR_S:g} s)")


def live_histories(histories: int, seed: int, lanes: int) -> None:
    """Live so many histories, some at a time, and print what happened in them. Raises what was wrong in one."""
    began_s, counts = time.monotonic(), Counter[str]()
    with ProcessPoolExecutor(lanes, multiprocessing.get_context("spawn")) as processes:
        for one in processes.map(run_histories, shares(histories, lanes), range(seed, seed + lanes)):
            counts.update(one)
    print(f"{counts.pop('histories', 0)} histories in {time.monotonic() - began_s:.0f} s,"
          f" {counts.pop('runs', 0)} runs, {counts.pop('departures', 0)} departures:"
          " nothing moved, armed, applied or forgotten otherwise than was asked for")  # fmt: skip
    for what, count in sorted(counts.items()):
        print(f"  {what:<51}{count:6}")


def shares(count: int, lanes: int) -> list[int]:
    return [count // lanes + (lane < count % lanes) for lane in range(lanes)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--histories", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--side-by-side", type=int, default=2, help="tortures at a time, each with its own store")
    options = parser.parse_args()
    lanes, stopped, began_s = options.side_by_side, threading.Event(), time.monotonic()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    with ThreadPoolExecutor(lanes) as threads:
        seeds = range(options.seed, options.seed + lanes)
        reports = list(threads.map(run_torture, shares(options.rounds, lanes), seeds, [stopped] * lanes))
    lost = [one.lost for one in reports if one.lost]
    print("\n".join(lost), end="")
    if not lost:
        report(reports, time.monotonic() - began_s)
    if options.histories and not lost and not stopped.is_set():
        live_histories(options.histories, options.seed, lanes)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
