"""kill -9, again and again, at random and at every failpoint: `python -m benchmarks.daemon.torture --rounds 1000`.

Each round starts a daemon on what the last one left, checks that everything that was ever acknowledged is there and
nothing is half there, sends the request that got no answer once more, works on, and is killed. The devices are the
tests' fakes; server, store, files, and the failpoints are what runs in a plant. kill -9 leaves what the system has in
its buffers: what a power cut would take as well is what `python -m benchmarks.daemon.disk_faults` is about. How soon a
daemon is ready again as a new process, and not forked from one that holds its imports: `python -m
benchmarks.daemon.restart`.
"""

import argparse
import contextlib
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
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import httpx
import numpy as np

from benchmarks.daemon.torture_daemon import STATIONS, WARM, daemon_process
from benchmarks.daemon.torture_ledger import Ledger, Lost, Request
from daemon.runtime.failpoints import PLACES
from tests.daemon.fakes import ply_of

READY_BAR_S = 5.0
ROUNDS_A_STORE = 25
AT_FAILPOINTS = 0.7
"""Of the rounds; the others are killed at random."""

POSE = "800,-100,900,0,1,0,0"


@dataclass
class Told:
    """What a torture has to tell at its end."""

    rounds: int = 0
    ready_s: list[float] = field(default_factory=list)
    killed: Counter[str] = field(default_factory=Counter)
    lost: str = ""


class Torture:
    """One store after the other, many daemons."""

    def __init__(self, folder: Path, chance: random.Random) -> None:
        self._folder, self._chance = folder, chance
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(WARM)
        warm = self._context.Process(target=int)  # the fork server's own imports are no start of a daemon
        warm.start()
        warm.join()
        self.told = Told()
        self._most = dict.fromkeys(PLACES, STATIONS)
        self._whole_round_s = 1.0
        self._begin()

    def _begin(self) -> None:
        shutil.rmtree(self._folder / "store", ignore_errors=True)
        (self._folder / "moves").write_text("")
        self._ledger, self._pending = Ledger(), None

    def round(self, number: int) -> None:
        """Start, check, go on, be killed. Raises Lost."""
        if number % ROUNDS_A_STORE == 0:
            self._begin()
        place, nth = "", 0
        if self._chance.random() < AT_FAILPOINTS:
            place = PLACES[number % len(PLACES)]
            nth = self._chance.randint(1, self._most[place])
        moves = (self._folder / "moves").read_text()
        ours, theirs = self._context.Pipe()
        began_s = time.monotonic()
        child = self._context.Process(
            target=daemon_process, args=(str(self._folder / "store"), place, nth, theirs), daemon=True
        )
        child.start()
        theirs.close()
        timer = threading.Timer(self._chance.uniform(0, self._whole_round_s), child.kill)
        if not place:
            timer.start()
        try:
            self.told.killed[self._until_killed(ours, moves, place or "at random", began_s)] += 1
        finally:
            timer.cancel()
            child.kill()
            child.join()
        self._learn()
        self.told.rounds = number + 1

    def _until_killed(self, ready: Connection, moves: str, place: str, began_s: float) -> str:
        """Where it was."""
        try:
            url = ready.recv()
        except (EOFError, ConnectionResetError):  # the next one goes on
            return f"{place}, while starting"
        self.told.ready_s.append(time.monotonic() - began_s)
        try:
            with httpx.Client(base_url=url, timeout=60, verify=False, trust_env=False) as client:
                self._work(client, moves)
        except httpx.HTTPError:
            return place
        self._whole_round_s = time.monotonic() - began_s
        return "at the end"

    def _learn(self) -> None:
        """How often a place can be reached in a round."""
        with contextlib.suppress(FileNotFoundError):
            for place, count in Counter((self._folder / "places").read_bytes()).items():
                self._most[PLACES[place]] = max(self._most[PLACES[place]], count)

    def _work(self, client: httpx.Client, moves: str) -> None:
        self._ledger.check(client, self._folder / "store", self._pending)
        if (self._folder / "moves").read_text() != moves:
            raise Lost("the arm moved, and nobody had asked")
        if self._pending is not None:
            self._send(client, self._pending)
        scan = self._send(client, Request("scan", "/scans", {"name": "part"}))
        for _ in range(2):
            self._send(client, Request("view", f"/scans/{scan['id']}/views?pose={POSE}", self._cloud()))
        run = self._send(client, Request("run", "/calibrate?wait=60", {"count": STATIONS}))
        if run["state"] == "finished":
            self._send(client, Request("apply", f"/calibrations/{run['id']}/apply", {"despite_verdict": True}))

    def _send(self, client: httpx.Client, request: Request) -> dict[str, object]:
        if request is not self._pending:
            self._ledger.sent[request.kind] += 1
        self._pending = request
        answer = request.send(client)
        self._ledger.acknowledged(request, answer, client)
        self._pending = None
        return answer

    def _cloud(self) -> bytes:
        return ply_of(np.random.default_rng(self._chance.randrange(2**32)).normal(0, 100, (2000, 3)))


def tortured(rounds: int, seed: int, stopped: threading.Event) -> Told:
    """A whole torture, in a folder that is left when something was lost."""
    folder = Path(tempfile.mkdtemp(prefix="handeyed-torture-"))
    torture = Torture(folder, random.Random(seed))
    try:
        while torture.told.rounds < rounds and not stopped.is_set():
            torture.round(torture.told.rounds)
    except Lost as lost:
        torture.told.lost = f"seed {seed}, round {torture.told.rounds}: {lost}\nthe store is left in {folder}"
        stopped.set()
        return torture.told
    shutil.rmtree(folder)
    return torture.told


def report(all_told: list[Told], took_s: float) -> None:
    """Printed."""
    killed = sum((told.killed for told in all_told), Counter[str]())
    ready_s = [seconds for told in all_told for seconds in told.ready_s]
    print(f"{sum(told.rounds for told in all_told)} rounds in {took_s:.0f} s:"
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
        all_told = list(threads.map(tortured, shares, seeds, [stopped] * lanes))
    lost = [told.lost for told in all_told if told.lost]
    print("\n".join(lost), end="")
    if not lost:
        report(all_told, time.monotonic() - began_s)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
